#include "core/procedure/report_captures.h"

#include <cmath>

#include <fmt/format.h>

#include "core/casestore/sha256.h"
#include "core/io/atomic_file.h"
#include "core/io/secondary_capture.h"
#include "core/procedure/report_picture.h"

namespace fluorocut {
namespace {

std::string uid(const std::string& of) {
    return uidFromHash(sha256("fluorocut capture\n" + of).substr(0, 32));
}

struct Series {
    int number;
    std::string name;  // of the files
    std::string description;
    std::string sentence;  // burned in
    const std::vector<ReportPicture>* pictures;
};

std::vector<Series> seriesOf(const ProcedureReport& report) {
    std::vector<Series> series;
    if (!report.plan_pictures.empty())
        series.push_back(
            {1, "planned", "FluoroCut: planned views", "the cavity as it is planned", &report.plan_pictures});
    if (!report.stages.empty() && !report.stages.back().pictures.empty()) {
        const ReportStage& last = report.stages.back();
        std::string sentence = "the cavity as it was planned and as it was found";
        if (std::isfinite(last.measured.mm))
            sentence +=
                fmt::format(", {:.2f} mm and {:.2f}° off at its worst place", last.measured.mm, last.measured.degrees);
        series.push_back({2, "final", "FluoroCut: final views", std::move(sentence), &last.pictures});
    }
    return series;
}

}  // namespace

Result<std::vector<std::string>> writeCaptures(const std::filesystem::path& folder, const ProcedureReport& report,
                                               const std::string& patient_id) {
    const std::vector<Series> all = seriesOf(report);
    if (all.empty())
        return noSolution("captures", "a case without a plan and without a located cut", "a procedure that was planned",
                          "go on with it");
    CaptureTags tags;
    tags.patient_name = report.patient;
    tags.patient_id = patient_id;
    tags.side = report.side;
    tags.study_uid = uid(report.case_id);
    tags.study_id = report.case_id.substr(0, 16);
    tags.study_description = "FluoroCut: " + report.title;
    tags.study_utc = report.created_utc;
    tags.software = report.software;
    std::vector<std::string> names;
    Result<void> written = writeWholeFolder(folder, [&](const std::filesystem::path& temporary) -> Result<void> {
        for (const Series& series : all) {
            // What was decided anew is another series.
            const std::string content = fmt::format("{}\n{}\n{}", report.case_id, report.newest_hash, series.name);
            tags.series_number = series.number;
            tags.series_description = series.description;
            tags.series_uid = uid(content);
            for (std::size_t i = 0; i < series.pictures->size(); ++i) {
                const ReportPicture& picture = (*series.pictures)[i];
                const Result<ColorImage> drawn =
                    burnedIn(picture, {fmt::format("{}, {} side", report.patient, report.side),
                                       fmt::format("{}: {}", picture.title, series.sentence),
                                       fmt::format("{}, research software, not a medical device. Case {}",
                                                   report.software, report.case_id)});
                if (!drawn) return drawn.error();
                tags.instance_number = static_cast<int>(i) + 1;
                tags.instance_uid = uid(fmt::format("{}\n{}", content, i));
                names.push_back(fmt::format("{}_{}.dcm", series.name, i + 1));
                if (Result<void> ok = writeCapture(temporary / names.back(), *drawn, tags); !ok) return ok;
            }
        }
        return {};
    });
    if (!written) return written.error();
    return names;
}

}  // namespace fluorocut

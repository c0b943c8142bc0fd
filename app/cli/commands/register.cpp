// register: where the femur is, for the imager (beads) and for the robot (chain), and where to look from next (advise).
#include "app/cli/commands/register.h"

#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "core/io/image_file.h"
#include "core/procedure/chain_measurement.h"

namespace fluorocut::cli {

Result<std::vector<std::string>> partsOf(const std::string& option, const std::string& text, std::size_t count,
                                         const std::string& form) {
    std::vector<std::string> parts(count);
    std::size_t end = text.size();
    bool good = true;
    for (std::size_t i = count; i-- > 1 && good;) {
        const std::size_t comma = end > 0 ? text.rfind(',', end - 1) : std::string::npos;
        good = comma != std::string::npos;
        if (!good) break;
        parts[i] = text.substr(comma + 1, end - comma - 1);
        end = comma;
    }
    parts[0] = text.substr(0, end);
    if (!good || std::any_of(parts.begin(), parts.end(), [](const std::string& part) { return part.empty(); }))
        return invalidOption(option, text, form);
    return parts;
}

Result<PictureOfImager> pictureOf(const BeadImage& files, Pictures& before) {
    Result<CArm> carm = readImager(files.carm);
    if (!carm) return carm.error();
    Result<ImageFile> file = readImage(files.image, {.frame = files.frame});
    if (!file) return file.error();
    if (file->info.width != carm->columns || file->info.height != carm->rows) {
        return invalidInput(files.image, fmt::format("{} x {} pixels", file->info.width, file->info.height),
                            fmt::format("the {} x {} of {}", carm->columns, carm->rows, files.carm),
                            "give each image the C-arm that it was taken with");
    }
    if (const Result<void> good = before.add(files.image, file->image); !good) return good.error();
    return PictureOfImager{std::move(file->image), std::move(*carm)};
}

Result<FemurView> beadViewOf(const BeadImage& files, const BeadLayout& layout, bool bright, Pictures& before,
                             Progress& progress) {
    const Result<PictureOfImager> picture = pictureOf(files, before);
    if (!picture) return picture.error();
    return fluorocut::beadViewOf(files.image, picture->image, picture->carm, layout, bright, progress);
}

Result<std::vector<NamedPoint>> pointsOf(const std::vector<std::string>& texts) {
    std::vector<NamedPoint> points;
    for (const std::string& text : texts) {
        NamedPoint point;
        const std::size_t equals = text.find('=');
        const std::string numbers = equals == std::string::npos ? text : text.substr(equals + 1);
        const Result<std::vector<std::string>> parts = partsOf("--at-mm", numbers, 3, "x,y,z or NAME=x,y,z in mm");
        if (!parts) return parts.error();
        for (std::size_t i = 0; i < 3; ++i) {
            double value = 0;
            if (!CLI::detail::lexical_cast((*parts)[i], value) || !(std::abs(value) <= 1e4))
                return invalidOption("--at-mm", text, "x,y,z or NAME=x,y,z in mm, each at most 10000");
            point.in_femur[static_cast<Eigen::Index>(i)] = value;
        }
        point.name = equals == std::string::npos ? "point " + text : text.substr(0, equals);
        points.push_back(std::move(point));
    }
    return points;
}

Command declareRegister(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("register", "Where the femur is: for the imager, for the robot");
    app->fallthrough();
    const std::vector<Command> kinds{declareRegisterBeads(*app), declareRegisterChain(*app),
                                     declareRegisterAdvise(*app)};
    app->footer("`fluorocut-cli register chain --help` tells its options.");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("register", "nothing to register", "beads, chain or advise", "see --help");
            }};
}

}  // namespace fluorocut::cli

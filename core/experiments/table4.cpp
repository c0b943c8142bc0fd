#include "core/experiments/table4.h"

#include <cstdlib>
#include <filesystem>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;

struct Folder {
    fs::path path;
    ~Folder() {
        std::error_code ignored;
        if (!path.empty()) fs::remove_all(path, ignored);
    }
};

Result<Table4Trial> runTrial(const Scenario& scenario, const fs::path& case_file, Progress& progress) {
    Table4Trial trial;
    trial.scenario = scenario.name;
    trial.seed = scenario.seed;
    auto run = runProcedure(scenario, case_file, progress);
    std::error_code ignored;
    fs::remove(case_file, ignored);
    if (run) {
        trial.run = std::move(*run);
    } else if (run.error().isCancelled() || run.error().code == ErrorCode::outputFailed) {
        return run.error();
    } else {
        trial.failure = run.error().message();
    }
    return trial;
}

}  // namespace

const std::array<PaperOffsets, kTable4Trials>& paperTable4() {
    static const std::array<PaperOffsets, kTable4Trials> table{
        {{{-2, -0.25}, {-0.64, -0.2}}, {{-1.604, 0.295}, {-0.13, -0.255}}, {{2.1, 1.3}, {0.95, 0.515}, {0.35, 0.025}}}};
    return table;
}

Result<void> Table4Options::validate() const {
    return requireRanges({{"trials", static_cast<double>(trials), 0, 10000, ""}});
}

Result<Table4> runTable4(const Table4Options& options, Progress& progress) {
    if (auto ok = options.validate(); !ok) return ok.error();
    const Stopwatch watch;
    std::error_code failed;
    std::string name = (fs::temp_directory_path(failed) / "fluorocut-table4-XXXXXX").string();
    if (failed || mkdtemp(name.data()) == nullptr)
        return outputFailed("temporary folder", "one that cannot be made", "free the disk");
    const Folder folder{name};
    std::array<Scenario, kTable4Trials> scenarios;
    for (std::size_t n = 0; n < kTable4Trials; ++n) {
        auto scenario = readScenario(fmt::format("table4-{}", n + 1));
        if (!scenario) return scenario.error();
        scenarios[n] = std::move(*scenario);
    }

    Table4 table;
    const int all = static_cast<int>(kTable4Trials) + options.trials;
    Random seeds(options.seed);
    for (int n = 0; n < all; ++n) {
        SubProgress part(progress, static_cast<double>(n) / all, (n + 1.0) / all);
        Scenario scenario = scenarios[static_cast<std::size_t>(n) % kTable4Trials];
        const bool of_paper = n < static_cast<int>(kTable4Trials);
        if (!of_paper) {
            scenario.seed = seeds.below(1'000'000'000);
            scenario.corkscrew.knock.reset();
        }
        auto trial = runTrial(scenario, folder.path / fmt::format("{}.case", n), part);
        if (!trial) return trial.error();
        (of_paper ? table.paper : table.random).push_back(std::move(*trial));
    }

    std::vector<double> final_mm, final_deg, first_mm, first_deg, worst_mm;
    for (const auto* trials : {&table.paper, &table.random}) {
        for (const Table4Trial& trial : *trials) {
            for (const StageFigures& stage : trial.run.stages) {
                ++table.cuts;
                table.bounds_broken += !stage.held;
            }
            if (!trial.run.finished) {
                ++(trial.failure.empty() ? table.stopped : table.failed);
                continue;
            }
            ++table.finished;
            const StageFigures &first = trial.run.stages.front(), &last = trial.run.stages.back();
            table.final_bounds_broken += !last.held;
            first_mm.push_back(first.truth.middle_mm);
            first_deg.push_back(degreesFromRadians(first.truth.turn_rad));
            final_mm.push_back(last.truth.middle_mm);
            final_deg.push_back(degreesFromRadians(last.truth.turn_rad));
            worst_mm.push_back(last.truth.most_mm);
        }
    }
    table.first_mm = figuresOf(first_mm);
    table.first_deg = figuresOf(first_deg);
    table.final_mm = figuresOf(final_mm);
    table.final_deg = figuresOf(final_deg);
    table.final_worst_place_mm = figuresOf(worst_mm);
    table.elapsed_ms = watch.ms();
    return table;
}

}  // namespace fluorocut

#include "core/distortion/grooved_plate.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/option_checks.h"
#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/plate/1";

}  // namespace

Result<void> GroovedPlate::validate() const {
    if (const Result<void> good = requireRanges(
            {{"pitch_mm", pitch_mm, 1, 100, "mm"},
             {"groove_width_mm", groove_width_mm, 0.05 * pitch_mm, 0.6 * pitch_mm, "mm (5 to 60 % of the pitch)"},
             {"thickness_mm", thickness_mm, 0.1, 100, "mm"},
             {"groove_depth_mm", groove_depth_mm, 0.01, thickness_mm, "mm (not deeper than the plate is thick)"}});
        !good) {
        return good.error();
    }
    for (const int count : grooves.value_or(std::array{4, 4})) {
        if (count < 4 || count > 1000) return invalidOption("grooves", std::to_string(count), "4 to 1000 of each");
    }
    return {};
}

double GroovedPlate::grooveContrast(double energy_kev) const {
    return attenuationPerMm(material, energy_kev) * groove_depth_mm;
}

Result<GroovedPlate> readGroovedPlate(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    GroovedPlate plate;
    plate.pitch_mm = file->number("pitch_mm");
    plate.groove_width_mm = file->number("groove_width_mm");
    plate.groove_depth_mm = file->number("groove_depth_mm");
    plate.thickness_mm = file->number("thickness_mm");
    const std::string material = file->text("material");
    if (const std::optional<Material> known = materialFromName(material)) {
        plate.material = *known;
    } else if (!file->failed()) {
        std::string all;
        for (const Material other : materials())
            all += (all.empty() ? "" : ", ") + std::string(name(other));
        file->fail("material", "\"" + material + "\"", "one of " + all);
    }
    if (!file->isNull("grooves")) {
        const std::vector<double> counts = file->numbers("grooves", 2);
        if (!file->failed()) {
            if (counts[0] != std::floor(counts[0]) || counts[1] != std::floor(counts[1]) ||
                !(std::max(counts[0], counts[1]) <= 1000) || !(std::min(counts[0], counts[1]) >= 4)) {
                file->fail("grooves", fmt::format("[{}, {}]", counts[0], counts[1]),
                           "two whole numbers from 4 to 1000, or null");
            } else {
                plate.grooves = {static_cast<int>(counts[0]), static_cast<int>(counts[1])};
            }
        }
    } else if (!file->has("grooves")) {
        file->fail("grooves", "nothing", "[columns, rows], or null for as many as are seen");
    }
    if (const Result<void> read = file->finish(); !read) return read.error();
    if (const Result<void> good = plate.validate(); !good) {
        return invalidInput(path.string() + ", field " + good.error().where, good.error().found, good.error().expected);
    }
    return plate;
}

Result<void> writeGroovedPlate(const std::filesystem::path& path, const GroovedPlate& plate) {
    nlohmann::ordered_json json = {{"schema", kSchema},
                                   {"pitch_mm", plate.pitch_mm},
                                   {"groove_width_mm", plate.groove_width_mm},
                                   {"groove_depth_mm", plate.groove_depth_mm},
                                   {"thickness_mm", plate.thickness_mm},
                                   {"material", name(plate.material)},
                                   {"grooves", nullptr}};
    if (plate.grooves) json["grooves"] = *plate.grooves;
    return writeWhole(path, json.dump(2) + "\n");
}

}  // namespace fluorocut

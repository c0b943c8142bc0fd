#include "core/fiducial/bead_layout.h"

#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/option_checks.h"
#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/beads/1";

}  // namespace

Result<void> BeadLayout::validate() const {
    if (beads.empty()) return invalidOption("beads", "none", "at least one bead");
    std::set<std::string_view> names;
    for (std::size_t i = 0; i < beads.size(); ++i) {
        const Bead& bead = beads[i];
        const std::string field = fmt::format("beads[{}].", i);
        if (!names.insert(bead.name).second)
            return invalidOption(field + "name", "\"" + bead.name + "\" a second time", "a name for each bead");
        if (!bead.center_mm.allFinite()) return invalidOption(field + "center_mm", "NaN", "three numbers");
        if (const Result<void> good = requireRange((field + "diameter_mm").c_str(), bead.diameter_mm, 0.1, 50, "mm");
            !good) {
            return good.error();
        }
        for (std::size_t j = 0; j < i; ++j) {
            const double apart_mm = (beads[j].center_mm - bead.center_mm).norm();
            if (!(apart_mm >= 0.5 * (beads[j].diameter_mm + bead.diameter_mm))) {
                return invalidOption(field + "center_mm",
                                     fmt::format("a bead {:.3g} mm from that of \"{}\"", apart_mm, beads[j].name),
                                     "beads that do not overlap");
            }
        }
    }
    return {};
}

Result<BeadLayout> readBeadLayout(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    BeadLayout layout;
    const std::string frame = file->text("frame");
    if (const std::optional<Frame> known = frameFromName(frame)) {
        layout.frame = *known;
    } else if (!file->failed()) {
        file->fail("frame", "\"" + frame + "\"", "the name of a frame, as \"phantom\" or \"femur\"");
    }
    for (JsonObject bead : file->objects("beads")) {
        layout.beads.push_back({bead.text("name"), bead.vector<3>("center_mm"), bead.number("diameter_mm")});
    }
    if (const Result<void> read = file->finish(); !read) return read.error();
    if (const Result<void> good = layout.validate(); !good) {
        return invalidInput(path.string() + ", field " + good.error().where, good.error().found, good.error().expected);
    }
    return layout;
}

Result<void> writeBeadLayout(const std::filesystem::path& path, const BeadLayout& layout) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    nlohmann::ordered_json beads = nlohmann::ordered_json::array();
    for (const Bead& bead : layout.beads) {
        beads.push_back({{"name", bead.name},
                         {"center_mm", {bead.center_mm.x(), bead.center_mm.y(), bead.center_mm.z()}},
                         {"diameter_mm", bead.diameter_mm}});
    }
    const nlohmann::ordered_json json = {{"schema", kSchema}, {"frame", name(layout.frame)}, {"beads", beads}};
    return writeWhole(path, json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace fluorocut

// The desktop's case in a case file (core/casestore): images, the CT and meshes as items of their own, each once under
// its hash, and after every edit one small document that names them:
//
//     {"schema": "fluorocut/desktop/1", "edit": "Move implant", "patient": "...", "side": "left",
//      "calibrated_utc": "...", "ct": HASH or null, "mu_water_per_mm": 0.02,
//      "canal": null or [x, y, z, x, y, z], "beads": [x, y, z, ...], "corkscrew": [{"points": [x, y, z, ...]}],
//      "views": [{"name": "AP", "orbital_rad": 0, "angulation_rad": 0, "isocentre_in_room": [0, 0, 0],
//                 "carm": {"name", "columns", "rows", "pixel_mm", "focal_length_mm", "principal_point_px"},
//                 "before": {"image": HASH, "pose": null or {"target", "source", "matrix", "covariance"},
//                            "unregistered_because": "", "registration_mm": 0.1, "corkscrew_pose": null or pose},
//                 "after": [...]}],
//      "plan": {"family", "size", "head_mm", "neck_mm", "locked", "implant": null or {its fields, meshes as HASH},
//               "mesh": HASH or null, "femur_from_implant", "cutter_radius_mm", "insets_mm",
//               "cavities": [HASH, ...], "tool_path": null or [x, y, z, ...]},
//      "measures": [{"kind": "length", "view": 0, "points_px": [x, y, x, y]}],
//      "head_center": [{"view": 0, "at_px": [x, y]}], "found_cavities": [pose, ...],
//      "femur_from_cutter": null or [[...]]}
//
// The newest document is the case. What is read is what was written: numbers to the last bit but for poses, whose
// rotations are made exactly orthonormal again (1e-15); a mesh's vertices are numbered by their first use. A C-arm's
// distortion is not kept yet: such a case is refused, by name of the view, rather than saved without it.
//
// Without Qt; any thread, one at a time.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/casestore/case_store.h"
#include "ui/session/case_state.h"

namespace fluorocut::ui {

// Writes states of one case into its file, one after another. What the file holds already is not written again.
class CaseWriter {
  public:
    // A file that is not there yet; or one with a case, which is gone on with.
    static Result<CaseWriter> create(const std::filesystem::path& path, const std::string& label);
    static Result<CaseWriter> append(const std::filesystem::path& path);

    // Once this returns, the state survives kill -9 and loss of power.
    Result<void> write(const CaseState& state, const std::string& edit);

  private:
    class Naming;  // of content by its hash

    explicit CaseWriter(CaseStore store) : store_(std::move(store)) {}

    CaseStore store_;
    std::set<std::string, std::less<>> held_;  // hashes in the file
    // Of objects in memory, so that an image is not hashed again with every edit.
    std::map<const void*, std::pair<std::weak_ptr<const void>, std::string>> known_;
};

// The case as its last edit left it. invalidInput names the file and the field.
Result<CaseState> readCase(const std::filesystem::path& path, Progress& progress = Progress::none());

// A file with this state alone, in place of what was there; whole or not at all.
Result<void> writeCase(const std::filesystem::path& path, const CaseState& state);

// Whether the file begins as a case does; nothing else is looked at.
bool looksLikeCase(const std::filesystem::path& path);

}  // namespace fluorocut::ui

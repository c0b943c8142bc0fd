// Files that a person opens, read into what a case is made of: images become views that are not registered yet, a CT
// the case's CT, a mesh its implant, a saved case the case itself. What a file is, its content says
// (core/io/file_format.h).
//
// The first file that cannot be read is the error; nothing is handed out then.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "ui/session/case_state.h"

namespace fluorocut::ui {

struct ReadFiles {
    std::optional<CaseState> whole;  // of a saved case; then the rest comes on top of it
    std::filesystem::path case_file;
    std::vector<CaseView> views;
    std::shared_ptr<const Volume> ct;
    std::shared_ptr<const Implant> implant;
    std::vector<std::string> notes;  // what the readers had to assume

    // The case with them in it.
    CaseState addedTo(CaseState state) const;
};

Result<ReadFiles> readCaseFiles(const std::vector<std::filesystem::path>& files, Progress& progress);

}  // namespace fluorocut::ui

// Where the data that comes with FluoroCut lies: resources/plates, resources/phantoms, ... (JSON).
//
// Looked for, in this order, as a folder:
//     $FLUOROCUT_RESOURCES             when it is set, it alone counts
//     <program>/../share/fluorocut     installed: the program lies in <prefix>/bin
//     <source>/resources               built and not installed: the checkout that it was built from
//
// A user names either a file or an entry ("paper" is resources/plates/paper.json); a file of that name comes first.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"

namespace fluorocut {

// The folder with all of it. invalidInput names the places that were looked at.
Result<std::filesystem::path> resourceFolder();

// The entries of one kind ("plates"): file names without .json, sorted. Empty when there are none.
std::vector<std::string> resourceNames(std::string_view kind);

// The file that `name` means. invalidInput tells the entries there are.
Result<std::filesystem::path> findResource(std::string_view kind, const std::string& name);

}  // namespace fluorocut

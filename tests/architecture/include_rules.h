// The rules of who may include whom, as functions of paths, so that they can be tried on bad examples.
//
// Paths are relative to the root of the sources ("core/imaging/carm.h"). A violation is a sentence; none is good.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fluorocut::architecture {

struct Include {
    int line = 0;
    std::string path;     // what stands between the quotes or brackets
    bool quoted = false;  // "..." rather than <...>
};

// Every #include of a source text, except those inside comments.
std::vector<Include> includesOf(std::string_view text);

// What is wrong with `file` including `include`; empty when nothing is.
std::string includeViolation(std::string_view file, const Include& include);

// The libraries fluorocut_<folder> that a core folder's CMakeLists.txt links.
std::vector<std::string> linkedFolders(std::string_view cmake_text);

// What is wrong with core/<folder> linking fluorocut_<linked>; empty when nothing is.
std::string linkViolation(std::string_view folder, std::string_view linked);

// The core folders in the order in which a later one may include an earlier one.
const std::vector<std::string>& coreFolders();

// The lines of `ldd` that name a library we keep out of the command line program.
std::vector<std::string> unwantedLibraries(std::string_view ldd_output);

}  // namespace fluorocut::architecture

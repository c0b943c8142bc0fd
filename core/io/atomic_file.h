// Outputs are written whole or not at all: into a temporary file beside the target, flushed to the disk, then renamed.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "core/base/result.h"

namespace fluorocut {

// Calls `write` with the path of a temporary file in the target's folder (same extension, so that writers that look at
// it work), then moves it over `target`. When anything fails the temporary file is removed and an old target stays.
Result<void> writeWhole(const std::filesystem::path& target,
                        const std::function<Result<void>(const std::filesystem::path& temporary)>& write);

// The same for content at hand.
Result<void> writeWhole(const std::filesystem::path& target, std::string_view content);

// A folder with everything in it or nothing at all: calls `write` with a temporary folder beside the target, then
// renames it. Refuses (invalidOption) a target that is a file or a folder that holds anything: nothing is overwritten.
Result<void> writeWholeFolder(const std::filesystem::path& target,
                              const std::function<Result<void>(const std::filesystem::path& temporary)>& write);

// What writeWholeFolder refuses, asked before long work.
Result<void> requireNewFolder(const std::filesystem::path& target);

}  // namespace fluorocut

// What commands check about their files before any work is done.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/imaging/carm.h"

namespace fluorocut::cli {

// Refuses, as wrong usage, an output whose folder does not exist, that is a folder itself, whose extension is none of
// `extensions` (with the dot, lower case; .nii.gz counts as one), or that would overwrite an input, under whatever name
// and through whatever link; for an input that is a folder, any file in it.
Result<void> checkOutput(const std::filesystem::path& output, const std::vector<std::filesystem::path>& inputs,
                         const std::vector<std::string>& extensions);

// A C-arm's file, with the distortion map that it names.
Result<CArm> readImager(const std::filesystem::path& path);

// ".png", ".nii.gz": lower case.
std::string extensionOf(const std::filesystem::path& path);

// "512 x 512 x 400"
template <class Sizes>
std::string timesText(const Sizes& sizes, const char* separator = " x ") {
    std::string text;
    for (const auto& size : sizes) {
        if (!text.empty()) text += separator;
        text += std::to_string(size);
    }
    return text;
}

}  // namespace fluorocut::cli

// Checks of option values that CLI11 lacks.
#pragma once

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace fluorocut::cli {

// Numbers from low to high. CLI11's own checks of a range let NaN pass.
inline CLI::Validator between(double low, double high) {
    return CLI::Validator(
        [low, high](std::string& text) -> std::string {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return {};
            return fmt::format("found {}, expected a number from {:g} to {:g}", text, low, high);
        },
        fmt::format("[{:g} - {:g}]", low, high));
}

}  // namespace fluorocut::cli

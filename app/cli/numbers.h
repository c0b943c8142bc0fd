// Vectors and matrices as JSON and as text.
#pragma once

#include <string>

#include <Eigen/Core>
#include <fmt/format.h>

#include "core/io/json_values.h"

namespace fluorocut::cli {

template <class Vector>
std::string listText(const Vector& vector, const char* format = "{:.5g}", const char* separator = ", ") {
    std::string text;
    for (Eigen::Index i = 0; i < vector.size(); ++i) {
        text += (i > 0 ? separator : "") + fmt::format(fmt::runtime(format), vector[i]);
    }
    return text;
}

}  // namespace fluorocut::cli

// Vectors and matrices as JSON and as text.
#pragma once

#include <string>

#include <Eigen/Core>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace fluorocut::cli {

template <class Vector>
nlohmann::ordered_json arrayOf(const Vector& vector) {
    nlohmann::ordered_json array = nlohmann::ordered_json::array();
    for (Eigen::Index i = 0; i < vector.size(); ++i)
        array.push_back(vector[i]);
    return array;
}

inline nlohmann::ordered_json rowsOf(const Eigen::MatrixXd& matrix) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (Eigen::Index r = 0; r < matrix.rows(); ++r)
        rows.push_back(arrayOf(matrix.row(r)));
    return rows;
}

template <class Vector>
std::string listText(const Vector& vector, const char* format = "{:.5g}", const char* separator = ", ") {
    std::string text;
    for (Eigen::Index i = 0; i < vector.size(); ++i) {
        text += (i > 0 ? separator : "") + fmt::format(fmt::runtime(format), vector[i]);
    }
    return text;
}

}  // namespace fluorocut::cli

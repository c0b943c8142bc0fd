// Vectors and matrices as JSON. For .cpp files that write JSON with the library itself.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace fluorocut {

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

}  // namespace fluorocut

// Poses as the command line's JSON has them.
#pragma once

#include <nlohmann/json.hpp>

#include "core/geometry/rigid3.h"

namespace fluorocut::test {

// Of a matrix, row by row.
template <class M>
nlohmann::json rows(const M& matrix) {
    nlohmann::json result = nlohmann::json::array();
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
        nlohmann::json row = nlohmann::json::array();
        for (Eigen::Index c = 0; c < matrix.cols(); ++c)
            row.push_back(matrix(r, c));
        result.push_back(row);
    }
    return result;
}

inline Rigid3 rigidOf(const nlohmann::json& rows) {
    Matrix4 m;
    for (int r = 0; r < 4; ++r)
        for (int c = 0; c < 4; ++c)
            m(r, c) = rows.at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c));
    return {Eigen::Quaterniond(Matrix3(m.topLeftCorner<3, 3>())), Vector3(m.topRightCorner<3, 1>())};
}

}  // namespace fluorocut::test

#include "tests/core/distortion/groove_truth.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fluorocut::test {

GrooveTruth compareWithTruth(const GroovePoints& points, const BentField& field, double pitch_mm) {
    const std::array<const std::vector<GroovePoint>*, 2> kinds = {&points.along_y, &points.along_x};
    GrooveTruth truth;
    truth.worst_label_error = std::numeric_limits<double>::infinity();
    bool exchanged = false;
    for (int symmetry = 0; symmetry < 8; ++symmetry) {
        double worst = 0;
        for (std::size_t kind = 0; kind < 2; ++kind) {
            const auto coordinate = static_cast<Eigen::Index>(kind ^ (symmetry & 1u));
            const double sign = (symmetry >> (kind + 1)) & 1 ? -1 : 1;
            std::vector<double> offsets;
            for (const GroovePoint& point : *kinds[kind])
                offsets.push_back(sign * field(point.pixel)[coordinate] / pitch_mm - point.index);
            if (offsets.empty()) continue;
            std::vector<double> sorted = offsets;
            std::sort(sorted.begin(), sorted.end());
            const double shift = std::round(sorted[sorted.size() / 2]);
            for (const double offset : offsets)
                worst = std::max(worst, std::abs(offset - shift));
        }
        if (worst < truth.worst_label_error) {
            truth.worst_label_error = worst;
            exchanged = symmetry & 1;
        }
    }
    for (std::size_t kind = 0; kind < 2; ++kind) {
        const auto coordinate = static_cast<Eigen::Index>(kind ^ (exchanged ? 1u : 0u));
        for (const GroovePoint& point : *kinds[kind]) {
            const auto at = [&](double du, double dv) {
                return field(point.pixel + Vector2(du, dv))[coordinate] / pitch_mm;
            };
            const Vector2 gradient(at(0.5, 0) - at(-0.5, 0), at(0, 0.5) - at(0, -0.5));
            const double place = at(0, 0);
            double error = (place - std::round(place)) / gradient.norm();
            if (gradient.dot(point.across) < 0) error = -error;
            truth.errors_px.push_back(error);
            truth.normalized.push_back(error / point.sigma_px);
            truth.mean_error_px[kind] += error / static_cast<double>(kinds[kind]->size());
        }
    }
    return truth;
}

double rootMeanSquare(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values)
        sum += value * value;
    return std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace fluorocut::test

#include "core/distortion/distortion_model.h"

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/distortion/models/bernstein_model.h"
#include "core/distortion/models/polynomial_model.h"
#include "core/distortion/models/table_model.h"
#include "core/distortion/models/thin_plate_spline_model.h"

namespace fluorocut {

const std::vector<DistortionModelKind>& distortionModels() {
    static const std::vector<DistortionModelKind> models = {
        {"polynomial", "one global polynomial, robustly fitted to all groove points", &fitPolynomialModel,
         &PolynomialModel::read},
        {"bernstein", "the paper's: a curve for each groove, cubic splines across them", &fitBernsteinModel,
         &BernsteinModel::read},
        {"thin-plate-spline", "a smoothing thin-plate spline through all groove points", &fitThinPlateSplineModel,
         &ThinPlateSplineModel::read},
        {"table", "values on a grid, computed from other maps", nullptr, &TableModel::read},
    };
    return models;
}

const DistortionModelKind* findDistortionModel(std::string_view name) {
    for (const DistortionModelKind& kind : distortionModels()) {
        if (kind.name == name) return &kind;
    }
    return nullptr;
}

Result<void> DistortionFitOptions::validate() const {
    const DistortionModelKind* kind = findDistortionModel(model);
    if (!kind || !kind->fit) {
        std::string known;
        for (const DistortionModelKind& other : distortionModels()) {
            if (other.fit) known += (known.empty() ? "" : ", ") + std::string(other.name);
        }
        return invalidOption("model", "\"" + model + "\"", "one of " + known);
    }
    if (order < 0 || order > 9) return invalidOption("order", fmt::format("{}", order), "1 to 9, or 0 for automatic");
    if (std::isnan(pixel_mm)) return {};
    return requireRange("pixel_mm", pixel_mm, 1e-3, 100, "mm");
}

void DistortionModel::plateFromRow(const Vector2& first, double step, std::span<Vector2> plate) const {
    for (std::size_t i = 0; i < plate.size(); ++i)
        plate[i] = plateFromPixel(first + Vector2(step * static_cast<double>(i), 0));
}

}  // namespace fluorocut

#include "core/fiducial/femur_bead_geometry.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/chi_square.h"
#include "core/base/units.h"

namespace fluorocut::femur_beads {
namespace {

// A pair that agrees is refused so often; images exchanged or a corkscrew that moved are off by degrees, at tenths.
constexpr double kUnlikely = 1e-6;

// Of k_from_x x_from_j, both with errors of their own.
Matrix6 covarianceBetween(const Rigid3& j, const Matrix6& of_j, const Rigid3& k, const Matrix6& of_k) {
    const Matrix6 by_k = productByLeft(k, j.inverse());
    const Matrix6 by_j = productByRight(k) * inverseByPose(j);
    return by_k * of_k * by_k.transpose() + by_j * of_j * by_j.transpose();
}

struct Gap {
    double chi_square = 0;
    double place_mm = 0, rotation_rad = 0;  // at the femur
};

// The worst of all pairs.
Gap worstGap(const std::vector<ViewAlone>& views) {
    Gap worst;
    for (std::size_t j = 0; j < views.size(); ++j) {
        for (std::size_t k = j + 1; k < views.size(); ++k) {
            const ViewAlone &a = views[j], &b = views[k];
            const Rigid3 seen = b.imager_from_femur * a.imager_from_femur.inverse();
            const Rigid3 known = b.imager_from_first * a.imager_from_first.inverse();
            const Vector6 gap = seen.deltaFrom(known);
            Matrix6 covariance =
                covarianceBetween(a.imager_from_femur, a.covariance, b.imager_from_femur, b.covariance) +
                covarianceBetween(a.imager_from_first, a.covariance_from_first, b.imager_from_first,
                                  b.covariance_from_first);
            covariance.diagonal().array() += 1e-14;  // what is exact stays solvable
            const double chi_square = gap.dot(covariance.ldlt().solve(gap));
            if (chi_square <= worst.chi_square) continue;
            const Vector3 femur = a.imager_from_femur.translation();
            worst = {chi_square, (seen * femur - known * femur).norm(), gap.tail<3>().norm()};
        }
    }
    return worst;
}

bool agree(const std::vector<ViewAlone>& views) {
    return worstGap(views).chi_square <= chiSquareQuantile(kUnlikely, 6);
}

std::vector<ViewAlone> exchanged(std::vector<ViewAlone> views, std::size_t i, std::size_t j) {
    std::swap(views[i].imager_from_femur, views[j].imager_from_femur);
    std::swap(views[i].covariance, views[j].covariance);
    return views;
}

std::string called(const ViewAlone& view) {
    return fmt::format("{} ({})", view.number, view.name);
}

}  // namespace

Result<void> checkKnownGeometry(const std::vector<ViewAlone>& views) {
    if (views.size() < 2 || agree(views)) return {};
    const Gap gap = worstGap(views);
    const std::string found =
        fmt::format("beads that contradict the known geometry of the views by {:.1f} mm and {:.1f} degrees",
                    gap.place_mm, degreesFromRadians(gap.rotation_rad));
    const std::string expected = "views that see the femur as the co-registration has them";
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < views.size(); ++i)
        for (std::size_t j = i + 1; j < views.size(); ++j)
            if (agree(exchanged(views, i, j))) pairs.emplace_back(i, j);
    if (pairs.size() == 1) {
        return invalidInput(
            fmt::format("views {} and {}", called(views[pairs[0].first]), called(views[pairs[0].second])),
            found + "; with the two images exchanged they fit: they seem to be swapped", expected,
            "give the views in the order that they were co-registered in");
    }
    std::vector<std::size_t> culprits;
    for (std::size_t i = 0; i < views.size() && views.size() > 2; ++i) {
        std::vector<ViewAlone> others = views;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        if (agree(others)) culprits.push_back(i);
    }
    const std::string advice =
        "co-register these very views in this order, with --robot-pose if the robot moved between them; if femur or "
        "C-arm "
        "moved, take new images";
    if (culprits.size() == 1)
        return invalidInput("view " + called(views[culprits[0]]), found + "; the other views agree", expected, advice);
    return invalidInput("the femur's beads", found, expected, advice);
}

}  // namespace fluorocut::femur_beads

// How well a cut cavity is located: Table 3 of the paper, with its five motions, and random ones, by every method in
// the same images.
//
//   paper            the paper's, from the images before and after
//   paper with CT    the same, the image before being the CT's projection at the pose of the image after
//   full             the fit to all views with the CT
//   full without CT  from the images before and after alone
//
// The error is the way of the cavity's middle and the angle of the turn between the answer and the truth; a truth lies
// in an answer's 95 % region when d^T C^-1 d is at most chi-square's 95 % quantile for 6 degrees of freedom. A gross
// failure is off by more than 1 mm or 3 degrees; it is unreported when the answer was accepted. Estimators see images,
// C-arms, poses as they are known, the plan and, where they are given one, the CT; never a truth.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/experiments/cavity_scenes.h"
#include "core/experiments/error_figures.h"

namespace fluorocut {

enum class CavityEstimator { paper, paperWithCt, full, fullWithoutCt };
inline constexpr std::array<CavityEstimator, 4> kCavityEstimators{
    CavityEstimator::paper, CavityEstimator::paperWithCt, CavityEstimator::full, CavityEstimator::fullWithoutCt};
const char* name(CavityEstimator estimator);  // "paper", "paper_with_ct", "full", "full_without_ct"

// Table 3. Expected and computed motion, and the paper's errors as printed.
struct PaperCavityTrial {
    CavityOffset expected, computed;
    double error_mm, error_deg;
};
inline constexpr std::size_t kPaperCavityTrials = 5;
const std::array<PaperCavityTrial, kPaperCavityTrials>& paperCavityTable();

struct CavityExperimentOptions {
    CavitySceneOptions scenes;
    bool paper_trials = true;
    int random_trials = 0;
    double random_mm = 3;  // of each shift and angle: uniform to either side
    double random_rad = radiansFromDegrees(4);
    std::uint64_t seed = 1;
    std::vector<CavityEstimator> estimators{kCavityEstimators.begin(), kCavityEstimators.end()};

    Result<void> validate() const;
};

struct CavityAnswer {
    bool answered = false, accepted = false;
    std::string refusal;    // the sentence, when there was no answer or it was not accepted
    CavityOffset computed;  // when answered
    double error_mm = std::numeric_limits<double>::quiet_NaN();
    double error_deg = std::numeric_limits<double>::quiet_NaN();
    double yaw_error_deg = std::numeric_limits<double>::quiet_NaN();  // about the stem's axis
    double chi_square = std::numeric_limits<double>::quiet_NaN();
    double contour_px = std::numeric_limits<double>::quiet_NaN();  // the worst view's
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();

    bool gross() const { return answered && !(error_mm <= 1 && error_deg <= 3); }
};

struct CavityTrial {
    CavityOffset expected;
    bool of_the_paper = false;
    std::vector<CavityAnswer> answers;  // one for each estimator
};

// Over some trials, of one estimator.
struct CavityFigures {
    int trials = 0, answered = 0, accepted = 0, gross_accepted = 0, gross = 0;
    ErrorFigures mm, deg, yaw_deg;  // of the answers
    double covered = std::numeric_limits<double>::quiet_NaN();
    double median_ms = std::numeric_limits<double>::quiet_NaN();
};

struct CavityExperiment {
    std::vector<CavityTrial> trials;  // the paper's first
    CavityFigures figures(std::size_t estimator, bool of_the_paper) const;
};

Result<CavityExperiment> runCavityExperiment(const CavityExperimentOptions& options,
                                             Progress& progress = Progress::none());

}  // namespace fluorocut

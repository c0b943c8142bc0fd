// One after-image as a function of where the cavity lies and of what is not known of the view:
//
//     log I = log( blur( exp( gone - g (D - usual) ) ) + level * added ) + slow
//     gone  = sharpened( g h K - fill P, edge ),    D = sharpened( line integral of the CT, sharp )
//
//     K, P          attenuation and way that the cavity took out (core/cavity/removed_bone.h)
//     g, h, fill    scale of attenuation, of what was removed by it, attenuation (1/mm) of what fills the cavity
//     edge, sharp   variances (mm^2, at the cavity) by which the cavity's edge is softer than the model's, and the bone
//                   sharper than the CT shows it: to first order by half the Laplacian, either sign
//     blur          of the detector and the focal spot together, variance in px^2
//     added, slow   polynomials: scatter and glare; gain
//
// D is taken at a pose and moved by its derivatives; a fresh look takes it anew.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "core/cavity/cavity_location.h"
#include "core/cavity/region_pixels.h"
#include "core/cavity/removed_bone.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {

// Unknowns of one view: its pose (6), then these.
enum Unknown : int { kG = 6, kRatio, kFill, kSoft, kEdge, kSharp, kPedestal, kPoly = kPedestal + kSlow };
inline constexpr int kOfView = kPoly + kSlow;
inline constexpr int kColumns = 6 + kOfView;  // of the Jacobian: the cavity's pose first

// What is known of an unknown beforehand: value and standard deviation; infinite where nothing is.
struct Known {
    double value, sigma;
};
using Beforehand = std::array<Known, kOfView>;

// Differences by the cavity's pose: (mm, rad).
inline constexpr double kStepMm = 0.15, kStepRad = 0.003;

class ViewModel {
  public:
    ViewModel(const CavityView& given, const Region& region, int main_axis, double px2_per_mm2,
              const Beforehand& known);

    // Takes the image in blocks of binning x binning pixels.
    void prepare(int binning);

    // Residual at the unknowns' values; `fresh` with D and derivatives taken anew, `there` holding what was removed at
    // the differences by the cavity's pose.
    void look(const VolumeProjector& bone, const Removed& here, bool fresh,
              const std::array<std::optional<Removed>, 6>& there);

    // Every pixel's weight: one over the variance that residuals have at its level, less (Cauchy) for those beyond
    // three deviations when `robust`. With `settle` only what the slow polynomial leaves counts.
    void weigh(bool robust, bool settle);

    // Share of the contrast which the cavity was expected to make that the image shows. The fit holds h near 1; asked
    // once more, and freely, while the beam's slow parts may follow: 1 where it is there, 0 where it is not.
    double evidence() const;

    // Adds `part` of a step and keeps the values within what can be.
    void move(const Vector6& delta, const Eigen::Matrix<double, kOfView, 1>& values,
              const Eigen::Matrix<double, kOfView, 1>& step, double part);

    Rigid3 pose() const { return given->after_imager_from_femur.perturbed(delta); }

    const CavityView* given;
    Region region;
    Beforehand known;
    CArm carm;  // the region, at this level
    Vector6 delta = Vector6::Zero();
    Eigen::Matrix<double, kOfView, 1> values = Eigen::Matrix<double, kOfView, 1>::Zero();  // the first six unused
    Eigen::VectorXf residual;
    Eigen::VectorXf noise;     // of every pixel
    Eigen::VectorXf weight;    // of every pixel
    double usual_noise = 1;    // robust standard deviation of the residual
    Eigen::MatrixXf jacobian;  // pixels x kColumns

  private:
    // What the model shows, and what it is made of.
    struct Beam {
        Image bone;                              // line integral of the CT
        ProjectionWithGradient removed, length;  // gradients only when fresh
        Image gone;                              // what is missing from the line integral, in all
        Image primary;                           // exp(gone - g bone)
        Image blurred;                           // without and
        Image seen;                              // with what is added to it
    };
    Image missing(const Image& bone, const Image& length) const;
    void differentiate(const Beam& beam, const std::array<std::optional<Removed>, 6>& there);
    // Standard deviation of the blur in this level's pixels. A block's average adds (b^2 - 1) / 12 px^2 to its
    // variance.
    double blur() const;
    ProjectionOptions axis() const;
    float px2() const { return static_cast<float>(px2_per_mm2_ / (binning_ * binning_)); }

    int main_axis_, binning_ = 1;
    double px2_per_mm2_;
    Image log_seen_;
    Eigen::VectorXf log_model_;
    double usual_bone_ = 0;  // mean line integral of the region
    double level_ = 0;       // geometric mean of exp(-g D): what is added is measured by it
    Image bone_;             // D where it was taken
    std::array<Image, 6> bone_by_pose_;
    Vector6 taken_at_ = Vector6::Zero();
    Eigen::MatrixXf basis_;  // pixels x kSlow
    Eigen::VectorXf clear_;  // of every pixel: 0 where something else covers it, 1 elsewhere
};

}  // namespace fluorocut::cavity

// The fast predicted image against exact path lengths through the meshes of the same layout, which it shares nothing
// with, and its derivatives against differences of predicted images.
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement.h"
#include "core/fiducial/corkscrew_refinement/predicted_image.h"
#include "core/fiducial/corkscrew_refinement/row_kernels.h"
#include "core/fiducial/corkscrew_solid.h"
#include "core/image/blur.h"
#include "core/imaging/mesh_projector.h"
#include "tests/support/fixtures.h"

namespace fluorocut::corkscrew {
namespace {

CorkscrewLayout layoutNamed(const std::string& name) {
    Result<CorkscrewLayout> read = readCorkscrew(std::string(FLUOROCUT_SOURCE_DIR) + "/resources/fiducials/" + name);
    EXPECT_OK(read);
    return *read;
}

Rigid3 poseAt(double twist_deg, double roll_deg, double pitch_deg, const Vector3& place) {
    constexpr double deg = 3.14159265358979323846 / 180;
    return Rigid3::fromTranslation(place) *
           Rigid3::fromTwistRollPitch(twist_deg * deg, roll_deg * deg, pitch_deg * deg);
}

// A few per cent of pincushion.
class Pincushion : public Distortion {
  public:
    Vector2 undistorted(const Vector2& d) const override { return d * (1 - 2.5e-6 * d.squaredNorm()); }
    Vector2 distorted(const Vector2& u) const override {
        Vector2 d = u;
        for (int i = 0; i < 50; ++i)
            d = u / (1 - 2.5e-6 * d.squaredNorm());
        return d;
    }
};

struct Lengths {
    Image wire, shaft, beads, rod;
};

Image sum(Image a, const Image& b, float factor = 1) {
    for (std::size_t i = 0; i < a.size(); ++i)
        a.pixels()[i] += factor * b.pixels()[i];
    return a;
}

Lengths exact(const CorkscrewLayout& layout, const CArm& carm, const Rigid3& pose) {
    const Result<CorkscrewSolid> solid = corkscrewSolid(layout);
    EXPECT_OK(solid);
    const auto of = [&](const TriangleMesh& mesh) {
        if (mesh.triangles.empty()) return Image(carm.columns, carm.rows);
        const Result<MeshProjector> projector = MeshProjector::prepare(mesh);
        EXPECT_OK(projector);
        return projector->project(carm, pose);
    };
    Lengths lengths{of(solid->helix), {}, Image(carm.columns, carm.rows), of(solid->rod)};
    for (const TriangleMesh& ring : solid->rings)
        lengths.wire = sum(lengths.wire, of(ring));
    for (const TriangleMesh& bead : solid->beads)
        lengths.beads = sum(lengths.beads, of(bead));
    const Image inside = of(solid->shaft_inside);
    lengths.shaft = sum(inside, of(solid->shaft_outside));
    lengths.rod = sum(sum(sum(lengths.rod, inside, -1), lengths.wire, -1), lengths.beads, -1);
    return lengths;
}

Image pixelMeans(const Image& fine, int factor) {
    Image out(fine.width() / factor, fine.height() / factor);
    for (int y = 0; y < fine.height(); ++y)
        for (int x = 0; x < fine.width(); ++x)
            out(x / factor, y / factor) += fine(x, y) / static_cast<float>(factor * factor);
    return out;
}

Image cut(const Image& image, const PixelRegion& region) {
    Image out(region.width, region.height);
    for (int y = 0; y < region.height; ++y)
        for (int x = 0; x < region.width; ++x)
            out(x, y) = image(region.x + x, region.y + y);
    return out;
}

double rmsDifference(const Image& a, const Image& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum += std::pow(a.pixels()[i] - b.pixels()[i], 2);
    return std::sqrt(sum / static_cast<double>(a.size()));
}

double rms(const Image& a) {
    return rmsDifference(a, Image(a.width(), a.height()));
}

double largest(const Image& a, const Image& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        most = std::max(most, std::abs(static_cast<double>(a.pixels()[i]) - b.pixels()[i]));
    return most;
}

struct Case {
    const char* layout;
    Rigid3 pose;
    bool distorted;
};

std::vector<Case> cases() {
    return {{"corkscrew.json", poseAt(30, 25, -40, {5, -5, 700}), false},
            {"corkscrew.json", poseAt(100, 0, 0, {0, 0, 700}), false},  // rings nearly edge on, wires end on
            {"corkscrew.json", poseAt(200, -55, 20, {-12, 9, 650}), true},
            {"corkscrew-paper.json", poseAt(300, 10, 80, {10, 15, 740}), true},
            {"corkscrew-paper.json", poseAt(0, 50, 170, {60, -30, 700}), false}};  // partly outside
}

CArm carmOf(const Case& c) {
    CArm carm;
    if (c.distorted) carm.distortion = std::make_shared<Pincushion>();
    return carm;
}

TEST(CorkscrewPredictedImage, AgreesWithTheExactPathLengthsOfMeshesSlow) {
    for (const Case& c : cases()) {
        const CorkscrewLayout layout = layoutNamed(c.layout);
        const CArm carm = carmOf(c);
        const PixelRegion region = regionAround(carm, layout, c.pose, 8);
        const CorkscrewPredictor predictor(carm, layout, region);
        const auto seen = predictor.pathLengths(c.pose);
        // The truth in an image of four times as many pixels along each axis: means over the pixel.
        constexpr int kFine = 4;
        CArm fine = carm;
        fine.columns *= kFine;
        fine.rows *= kFine;
        fine.pixel_mm /= kFine;
        fine.principal_point_px = (carm.principal_point_px.array() + 0.5) * kFine - 0.5;
        const Lengths of_fine = exact(layout, fine, c.pose);
        const Lengths mesh{pixelMeans(of_fine.wire, kFine), pixelMeans(of_fine.shaft, kFine),
                           pixelMeans(of_fine.beads, kFine), pixelMeans(of_fine.rod, kFine)};
        // 2 x 2 samples a pixel against 6 x 6: at a wire's limb they differ, which the detector's blur takes away.
        // Where a wire is seen end on, 7 mm of it lie in a pixel.
        EXPECT_LT(rmsDifference(seen[wire], cut(mesh.wire, region)), 0.02 * rms(seen[wire]));
        EXPECT_LT(rmsDifference(seen[shaft], cut(mesh.shaft, region)), 0.02 * rms(seen[shaft]));
        EXPECT_LT(rmsDifference(seen[rod], cut(mesh.rod, region)), 0.01 * rms(seen[rod]));
        if (!layout.beads.empty()) {
            EXPECT_LT(rmsDifference(seen[beads], cut(mesh.beads, region)), 0.02 * rms(seen[beads]));
        }
        const std::array<double, kParts> gains{1, 1, 1, 1};
        const Image predicted = gaussianBlurred(predictor.predict(c.pose, gains, Derivatives::none).transmission, 0.7);
        Image through;
        const double mu_wire = attenuationPerMm(layout.wire), mu_shaft = attenuationPerMm(layout.shaft);
        const double mu_rod = attenuationPerMm(layout.rod);
        Image fine_through = of_fine.wire;
        for (std::size_t i = 0; i < fine_through.size(); ++i) {
            const double metal = of_fine.shaft.pixels()[i] + of_fine.beads.pixels()[i];
            fine_through.pixels()[i] = static_cast<float>(
                std::exp(-mu_wire * of_fine.wire.pixels()[i] - mu_shaft * metal - mu_rod * of_fine.rod.pixels()[i]));
        }
        through = cut(pixelMeans(fine_through, kFine), region);
        const Image blurred = gaussianBlurred(through, 0.7);
        EXPECT_LT(rmsDifference(predicted, blurred), 0.003);
        EXPECT_LT(largest(predicted, blurred), 0.08);
    }
}

// Slope and correlation of the derivative with a central difference, after the detector's blur.
void expectSameDerivative(const Image& derivative, const Image& plus, const Image& minus, double step, double tolerance,
                          const std::string& what) {
    Image difference = sum(plus, minus, -1);
    const Image smooth = gaussianBlurred(derivative, 0.75), expected = gaussianBlurred(difference, 0.75);
    double with = 0, of_smooth = 0, of_expected = 0;
    for (std::size_t i = 0; i < smooth.size(); ++i) {
        const double a = smooth.pixels()[i], b = expected.pixels()[i] / (2 * step);
        with += a * b;
        of_smooth += a * a;
        of_expected += b * b;
    }
    if (of_expected == 0 && of_smooth == 0) return;  // outside the image
    EXPECT_NEAR(with / of_expected, 1, tolerance) << what;
    EXPECT_GT(with / std::sqrt(of_smooth * of_expected), 1 - tolerance) << what;
}

TEST(CorkscrewPredictedImage, DerivativesAreThoseOfTheImage) {
    for (const Case& c : cases()) {
        const CorkscrewLayout layout = layoutNamed(c.layout);
        const CArm carm = carmOf(c);
        const PixelRegion region = regionAround(carm, layout, c.pose, 8);
        const CorkscrewPredictor predictor(carm, layout, region);
        // The rod does not pull.
        const std::array<double, kParts> gains{1.1, 1, 0.9, 0};
        const PredictedImage at = predictor.predict(c.pose, gains, Derivatives::all);
        const auto predict = [&](const CorkscrewPredictor& other, const Rigid3& pose) {
            return other.predict(pose, gains, Derivatives::none).transmission;
        };
        const double steps[6] = {0.06, 0.06, 1, 2e-3, 2e-3, 2e-3};
        for (int k = 0; k < 6; ++k) {
            Vector6 delta = Vector6::Zero();
            delta[k] = steps[k];
            expectSameDerivative(at.pose[static_cast<std::size_t>(k)], predict(predictor, c.pose.perturbed(delta)),
                                 predict(predictor, c.pose.perturbed(-delta)), steps[k], 0.08,
                                 "pose " + std::to_string(k));
        }
        // What images share.
        const std::vector<std::string> names = corkscrewParameters(layout);
        for (std::size_t k = 0; k < names.size(); ++k) {
            const double step = k == 0 ? 1e-3 : k < 3 ? 0.3 : names[k] == "helix phase" ? 4e-3 : 0.06;
            Eigen::VectorXd delta = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
            delta[static_cast<Eigen::Index>(k)] = step;
            const Image plus = predict({withParameters(carm, delta), withParameters(layout, delta), region}, c.pose);
            const Image minus = predict({withParameters(carm, -delta), withParameters(layout, -delta), region}, c.pose);
            Image derivative(region.width, region.height);
            if (k < 3) {
                derivative = at.imager[k];
            } else {
                for (std::size_t g = 0; g < at.groups.size(); ++g) {
                    const int plane = static_cast<int>(k) - 3 - predictor.solid().groups[g].first_parameter;
                    const GroupDerivatives& group = at.groups[g];
                    if (plane < 0 || plane >= static_cast<int>(group.planes.size())) continue;
                    for (int y = 0; y < group.box.height; ++y)
                        for (int x = 0; x < group.box.width; ++x)
                            derivative(group.box.x + x, group.box.y + y) =
                                group.planes[static_cast<std::size_t>(plane)](x, y);
                }
            }
            // A wire seen end on has limbs on all sides; a bead that moves toward the source hardly changes.
            expectSameDerivative(derivative, plus, minus, step, k < 3 ? 0.08 : 0.2, names[k]);
        }
        // What a sample at a limb stands for depends a little on the gain itself.
        for (std::size_t k = 0; k < kParts; ++k) {
            if (k == beads && layout.beads.empty()) continue;
            auto more = gains, less = gains;
            more[k] += 0.01;
            less[k] -= 0.01;
            expectSameDerivative(at.gains[k], predictor.predict(c.pose, more, Derivatives::none).transmission,
                                 predictor.predict(c.pose, less, Derivatives::none).transmission, 0.01, 0.06,
                                 "gain " + std::to_string(k));
        }
    }
}

}  // namespace
}  // namespace fluorocut::corkscrew

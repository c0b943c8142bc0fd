#include "core/geometry/pose.h"

#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

Matrix6 someCovariance(Random& random, double translation_mm, double rotation_rad) {
    Matrix6 a;
    for (int r = 0; r < 6; ++r) {
        for (int c = 0; c < 6; ++c)
            a(r, c) = random.normal() * (r < 3 ? translation_mm : rotation_rad);
    }
    return a * a.transpose() / 6;
}

Vector6 draw(Random& random, const Matrix6& covariance) {
    Vector6 z;
    for (int i = 0; i < 6; ++i)
        z[i] = random.normal();
    return covariance.llt().matrixL() * z;
}

// Whitened sample covariance must be the identity: 20,000 draws give each entry a standard error below 0.01.
void expectCovariance(const std::vector<Vector6>& deltas, const Matrix6& predicted) {
    Matrix6 sample = Matrix6::Zero();
    for (const Vector6& d : deltas)
        sample += d * d.transpose();
    sample /= static_cast<double>(deltas.size());
    const Matrix6 whitener = Matrix6(predicted.llt().matrixL()).inverse();
    EXPECT_LT((whitener * sample * whitener.transpose() - Matrix6::Identity()).cwiseAbs().maxCoeff(), 0.06);
}

TEST(Pose, CompositionAndInverseTransportCovarianceAsMonteCarloDoes) {
    Random random(42);
    Pose a{Frame::robot, Frame::corkscrew, exp((Vector6() << 100, 20, -40, 0.4, 1.0, -0.7).finished()), {}};
    Pose b{Frame::corkscrew, Frame::imager, exp((Vector6() << 10, -60, 700, 1.4, -0.2, 0.3).finished()), {}};
    a.covariance = someCovariance(random, 0.1, 0.001);
    b.covariance = someCovariance(random, 0.2, 0.0005);
    const Pose c = a * b;
    const Pose inverse = a.inverse();
    EXPECT_EQ(c.target, Frame::robot);
    EXPECT_EQ(c.source, Frame::imager);
    std::vector<Vector6> of_product, of_inverse;
    for (int i = 0; i < 20000; ++i) {
        const Rigid3 noisy_a = a.target_from_source.perturbed(draw(random, *a.covariance));
        const Rigid3 noisy_b = b.target_from_source.perturbed(draw(random, *b.covariance));
        of_product.push_back((noisy_a * noisy_b).deltaFrom(c.target_from_source));
        of_inverse.push_back(noisy_a.inverse().deltaFrom(inverse.target_from_source));
    }
    expectCovariance(of_product, *c.covariance);
    expectCovariance(of_inverse, *inverse.covariance);
}

TEST(Pose, FramesThatDoNotCancelAreABrokenContract) {
    const Pose robot_from_corkscrew{Frame::robot, Frame::corkscrew, {}, {}};
    const Pose imager_from_femur{Frame::imager, Frame::femur, {}, {}};
    EXPECT_THROW((void)(robot_from_corkscrew * imager_from_femur), std::logic_error);
}

TEST(Pose, UnknownCovarianceStaysUnknown) {
    const Pose a{Frame::robot, Frame::corkscrew, {}, Matrix6(Matrix6::Identity())};
    const Pose b{Frame::corkscrew, Frame::imager, {}, std::nullopt};
    EXPECT_FALSE((a * b).covariance.has_value());
    EXPECT_THROW((void)pointCovariance(b, Vector3::Zero()), std::logic_error);
}

TEST(Frames, NamesGoThereAndBack) {
    for (const Frame frame : {Frame::femur, Frame::imager, Frame::corkscrew, Frame::robot, Frame::flange, Frame::cutter,
                              Frame::cavity, Frame::plate, Frame::phantom}) {
        EXPECT_EQ(frameFromName(name(frame)), frame);
    }
    EXPECT_EQ(frameFromName("pelvis"), std::nullopt);
}

}  // namespace
}  // namespace fluorocut

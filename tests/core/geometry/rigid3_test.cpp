#include "core/geometry/rigid3.h"

#include <cmath>

#include <gtest/gtest.h>
#include <unsupported/Eigen/MatrixFunctions>

#include "core/base/random.h"

namespace fluorocut {
namespace {

Vector6 randomTwist(Random& random, double translation_mm, double rotation_rad) {
    Vector6 twist;
    for (int i = 0; i < 3; ++i)
        twist[i] = random.uniform(-translation_mm, translation_mm);
    for (int i = 3; i < 6; ++i)
        twist[i] = random.uniform(-rotation_rad, rotation_rad);
    return twist;
}

TEST(Rigid3, CompositionInverseAndMatrixAgree) {
    Random random(1);
    for (int trial = 0; trial < 100; ++trial) {
        const Rigid3 a = exp(randomTwist(random, 200, 1.5)), b = exp(randomTwist(random, 200, 1.5));
        EXPECT_LT(((a * b).matrix() - a.matrix() * b.matrix()).norm(), 1e-11);
        EXPECT_LT(((a * a.inverse()).matrix() - Matrix4::Identity()).norm(), 1e-12);
        const Vector3 p(1, -2, 3);
        EXPECT_LT((a * p - (a.matrix() * p.homogeneous()).head<3>()).norm(), 1e-12);
    }
}

// Against Eigen's dense matrix exponential, an independent program.
TEST(Rigid3, ExpIsTheMatrixExponentialAndLogItsInverse) {
    Random random(2);
    for (const double size : {1e-9, 1e-5, 1e-3, 0.3, 1.5}) {
        for (int trial = 0; trial < 20; ++trial) {
            const Vector6 twist = randomTwist(random, 50, size);
            Matrix4 generator = Matrix4::Zero();
            generator.topLeftCorner<3, 3>() = skew(twist.tail<3>());
            generator.topRightCorner<3, 1>() = twist.head<3>();
            EXPECT_LT((exp(twist).matrix() - generator.exp()).norm(), 1e-11) << size;
            EXPECT_LT((log(exp(twist)) - twist).norm(), 1e-10) << size;
        }
    }
}

TEST(Rigid3, RotationLogIsRightAtHalfATurn) {
    const Vector3 axis = Vector3(1, 2, -2) / 3;
    for (const double angle : {M_PI - 1e-9, M_PI - 1e-3, M_PI}) {
        const Vector3 w = logRotation(expRotation(angle * axis));
        EXPECT_NEAR(w.norm(), angle, 1e-12);
        EXPECT_NEAR(std::abs(w.normalized().dot(axis)), 1, 1e-12);
    }
}

TEST(Rigid3, PerturbationAndDeltaAreInverse) {
    Random random(3);
    for (int trial = 0; trial < 50; ++trial) {
        const Rigid3 reference = exp(randomTwist(random, 500, 2));
        const Vector6 delta = randomTwist(random, 5, 0.5);
        EXPECT_LT((reference.perturbed(delta).deltaFrom(reference) - delta).norm(), 1e-12);
    }
    // Translation moves the source's origin, rotation leaves it where it is.
    const Rigid3 pose(expRotation({0.1, 0.2, 0.3}), {1, 2, 3});
    Vector6 rotation_only = Vector6::Zero();
    rotation_only.tail<3>() = Vector3(0.1, 0, 0);
    EXPECT_EQ(pose.perturbed(rotation_only).translation(), pose.translation());
}

// Equation 6 of the paper, written out.
TEST(Rigid3, TwistRollPitchIsEquationSix) {
    const double a = 0.4, b = -0.3, g = 1.2;
    Matrix3 expected;
    expected << cos(g) * cos(b), cos(g) * sin(b) * sin(a) - sin(g) * cos(a), cos(g) * sin(b) * cos(a) + sin(g) * sin(a),
        sin(g) * cos(b), sin(g) * sin(b) * sin(a) + cos(g) * cos(a), sin(g) * sin(b) * cos(a) - cos(g) * sin(a),
        -sin(b), cos(b) * sin(a), cos(b) * cos(a);
    const Rigid3 rotation = Rigid3::fromTwistRollPitch(a, b, g);
    EXPECT_LT((rotation.rotationMatrix() - expected).norm(), 1e-15);
    EXPECT_LT((rotation.twistRollPitch() - Vector3(a, b, g)).norm(), 1e-14);
    // At gimbal lock the angles are not unique, the rotation is.
    const Rigid3 lock = Rigid3::fromTwistRollPitch(0.7, M_PI / 2, 0.2);
    const Vector3 angles = lock.twistRollPitch();
    EXPECT_LT(
        (Rigid3::fromTwistRollPitch(angles[0], angles[1], angles[2]).rotationMatrix() - lock.rotationMatrix()).norm(),
        1e-7);
}

TEST(Rigid3, RefusesWhatIsNotARotation) {
    EXPECT_THROW(Rigid3(Matrix3(2 * Matrix3::Identity()), Vector3::Zero()), std::logic_error);
    EXPECT_THROW(Rigid3(Matrix3(-Matrix3::Identity()), Vector3::Zero()), std::logic_error);
    EXPECT_THROW(Rigid3::fromTranslation({0, NAN, 0}), std::logic_error);
}

}  // namespace
}  // namespace fluorocut

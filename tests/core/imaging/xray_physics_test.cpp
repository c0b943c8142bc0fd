#include "core/imaging/xray_physics.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

CArm carmOf(int size) {
    CArm carm;
    carm.columns = carm.rows = size;
    carm.principal_point_px = Vector2::Constant((size - 1) / 2.0);
    return carm;
}

struct Statistics {
    double mean = 0, variance = 0;
};

Statistics statistics(const Image& image) {
    Statistics result;
    for (const float value : image.pixels())
        result.mean += value;
    result.mean /= static_cast<double>(image.size());
    for (const float value : image.pixels())
        result.variance += std::pow(value - result.mean, 2);
    result.variance /= static_cast<double>(image.size());
    return result;
}

// A disc of line integral 3 in the open beam: edges, open field, shadow.
Image disc(int size) {
    Image image(size, size);
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            if (std::hypot(x - size / 2, y - size / 2) < size / 4.0) image(x, y) = 3;
    return image;
}

TEST(XrayPhysics, IdealImageIsBeerLambert) {
    Image line_integrals(64, 64);
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x)
            line_integrals(x, y) = static_cast<float>(0.1 * x);
    const auto exposure = expose(line_integrals, carmOf(64), XrayOptions::ideal(5000));
    ASSERT_OK(exposure);
    for (int x = 0; x < 64; ++x)  // float arithmetic
        EXPECT_NEAR(exposure->image(x, 10), 5000 * std::exp(-0.1 * x), 1e-6 * 5000);
}

// Mean and variance of a flat field are both N; five standard errors: sqrt(N / n) and N sqrt(2 / n) (normal limit, plus
// the Poisson's excess 1 / N).
TEST(XrayPhysics, QuantaOfAFlatFieldArePoisson) {
    for (const double photons : {3.0, 40.0, 2000.0}) {
        XrayOptions options = XrayOptions::ideal(photons * std::exp(1.5));
        options.quantum_noise = true;
        const Image line_integrals(256, 256, 1.5f);
        const auto exposure = expose(line_integrals, carmOf(256), options);
        ASSERT_OK(exposure);
        const Statistics s = statistics(exposure->image);
        const double n = 256.0 * 256.0;
        EXPECT_NEAR(s.mean, photons, 5 * std::sqrt(photons / n));
        EXPECT_NEAR(s.variance, photons, 5 * photons * std::sqrt((2 + 1 / photons) / n));
        EXPECT_NEAR(exposure->mean_photons, photons, 1e-5 * photons);
    }
}

// White noise of variance N through the discrete Gaussian of variance t = s^2 keeps the share (exp(-2t) I0(2t))^2, the
// sum of the squared weights; drawn after the blur it keeps all. Pixels are correlated over the blur, which takes their
// effective number down by the kernel's area, 4 pi s^2 = 12: standard error N * share * sqrt(2 * 12 / n).
TEST(XrayPhysics, DetectorBlurCorrelatesTheNoise) {
    XrayOptions options = XrayOptions::ideal(1000);
    options.quantum_noise = true;
    options.detector_blur_px = 1.0;
    const Image open(256, 256);
    const auto correlated = expose(open, carmOf(256), options);
    options.correlated_noise = false;
    const auto white = expose(open, carmOf(256), options);
    ASSERT_OK(correlated);
    ASSERT_OK(white);
    const double n = 256.0 * 256.0;
    const double share = std::pow(std::exp(-2.0) * std::cyl_bessel_i(0, 2.0), 2);
    EXPECT_NEAR(statistics(correlated->image).variance, 1000 * share, 5 * 1000 * share * std::sqrt(24 / n));
    EXPECT_NEAR(statistics(white->image).variance, 1000, 5 * 1000 * std::sqrt(2 / n));

    const auto neighbourCorrelation = [](const Image& image) {
        const Statistics s = statistics(image);
        double sum = 0;
        for (int y = 0; y < 256; ++y)
            for (int x = 1; x < 256; ++x)
                sum += (image(x, y) - s.mean) * (image(x - 1, y) - s.mean);
        return sum / (255.0 * 256.0) / s.variance;
    };
    // At lag 1 the discrete Gaussian's autocorrelation is I1(2t) / I0(2t).
    EXPECT_NEAR(neighbourCorrelation(correlated->image), std::cyl_bessel_i(1, 2.0) / std::cyl_bessel_i(0, 2.0), 0.03);
    EXPECT_NEAR(neighbourCorrelation(white->image), 0, 5 / std::sqrt(n));
}

TEST(XrayPhysics, BlurActsOnIntensitiesAndKeepsTheirSum) {
    XrayOptions options = XrayOptions::ideal(1000);
    const auto sharp = expose(disc(128), carmOf(128), options);
    options.detector_blur_px = 2;
    options.focal_spot_mm = 1.2;
    options.object_depth_mm = 600;
    const auto blurred = expose(disc(128), carmOf(128), options);
    options.glare_fraction = 0.2;
    options.glare_sigma_mm = 10;
    const auto glaring = expose(disc(128), carmOf(128), options);
    ASSERT_OK(sharp);
    ASSERT_OK(blurred);
    ASSERT_OK(glaring);
    const double mean = statistics(sharp->image).mean;
    EXPECT_NEAR(statistics(blurred->image).mean, mean, 1e-4 * mean);
    EXPECT_NEAR(statistics(glaring->image).mean, mean, 1e-4 * mean);
    EXPECT_NE(blurred->image, sharp->image);
    // In the middle of the disc, blur changes nothing and glare fills the shadow from the open beam.
    EXPECT_NEAR(blurred->image(64, 64), 1000 * std::exp(-3.0), 0.01);
    EXPECT_GT(glaring->image(64, 64), 1000 * std::exp(-3.0) + 0.2 * 100);
}

// The penumbra of a square spot of 0.6 mm at magnification 1000/650, by hand: 0.6 / sqrt(12) * 0.53846 / 0.32 px.
TEST(XrayPhysics, PenumbraGrowsWithMagnification) {
    const CArm carm = carmOf(64);
    EXPECT_NEAR(penumbraSigmaPx(carm, 0.6, 650), 0.29146, 1e-4);
    EXPECT_EQ(penumbraSigmaPx(carm, 0.6, carm.focal_length_mm), 0);  // on the detector there is none
}

// Below a uniform slab of line integral t the scatter is s t of the primary; whatever the object, its sum is s times
// the sum of P t, because the kernel's sum is one.
TEST(XrayPhysics, ScatterIsInProportionToWhatWasCrossed) {
    XrayOptions options = XrayOptions::ideal(1000);
    options.scatter_per_attenuation = 0.15;
    const auto slab = expose(Image(128, 128, 4.0f), carmOf(128), options);
    const auto open = expose(Image(128, 128, 0.0f), carmOf(128), options);
    const auto object = expose(disc(128), carmOf(128), options);
    const auto primary = expose(disc(128), carmOf(128), XrayOptions::ideal(1000));
    ASSERT_OK(slab);
    ASSERT_OK(object);
    const double p = 1000 * std::exp(-4.0);
    EXPECT_NEAR(slab->image(64, 64), p * (1 + 0.15 * 4), 1e-4 * p);
    EXPECT_EQ(open->image(64, 64), 1000);
    double expected = 0;
    const Image line_integrals = disc(128);
    for (const float t : line_integrals.pixels())
        expected += 0.15 * 1000 * std::exp(-t) * t;
    const double found =
        (statistics(object->image).mean - statistics(primary->image).mean) * static_cast<double>(object->image.size());
    EXPECT_NEAR(found, expected, 1e-3 * expected);
}

// Pixels whose centres lie within the radius see the beam, the others nothing: counted one by one. Automatic brightness
// looks at the field alone.
TEST(XrayPhysics, TheRoundFieldIsDarkOutside) {
    const CArm carm = carmOf(100);
    XrayOptions options = XrayOptions::ideal(1000);
    options.field_radius_mm = 12;
    const auto exposure = expose(Image(100, 100, 1.0f), carm, options);
    ASSERT_OK(exposure);
    for (int y = 0; y < 100; ++y) {
        for (int x = 0; x < 100; ++x) {
            const bool inside = std::hypot(x - 49.5, y - 49.5) * 0.32 <= 12;
            ASSERT_NEAR(exposure->image(x, y), inside ? 1000 * std::exp(-1.0) : 0, 1e-3) << x << " " << y;
        }
    }
    options.bits = 16;
    options.gain.reset();
    EXPECT_NEAR(expose(Image(100, 100, 1.0f), carm, options)->image(50, 50), 0.25 * 65535, 1);
}

TEST(XrayPhysics, MeasuredKernelsReplaceTheGaussians) {
    XrayOptions options = XrayOptions::ideal(1000);
    options.detector_blur_px = 5;  // ignored
    options.detector_kernel = Image(1, 1, 3.0f);
    options.focal_kernel = Image(1, 1, 1.0f);
    const auto same = expose(disc(64), carmOf(64), options);
    const auto ideal = expose(disc(64), carmOf(64), XrayOptions::ideal(1000));
    ASSERT_OK(same);
    EXPECT_EQ(same->image, ideal->image);
    options.detector_kernel = Image(3, 3, 1.0f);
    const auto box = expose(disc(64), carmOf(64), options);
    double mean = 0;
    for (int y = 15; y <= 17; ++y)
        for (int x = 31; x <= 33; ++x)
            mean += ideal->image(x, y) / 9;
    EXPECT_NEAR(box->image(32, 16), mean, 1e-3);
}

TEST(XrayPhysics, SaturatesAndRoundsExactly) {
    Image line_integrals(4, 4);
    line_integrals(1, 0) = static_cast<float>(std::log(2.0));
    line_integrals(2, 0) = 20;
    for (const int bits : {8, 12, 16}) {
        XrayOptions options = XrayOptions::ideal(1000);
        options.bits = bits;
        const double top = std::ldexp(1.0, bits) - 1;
        options.gain = 1.25 * top / 1000;
        options.offset = 3;
        const auto exposure = expose(line_integrals, carmOf(4), options);
        ASSERT_OK(exposure);
        EXPECT_EQ(exposure->image(0, 0), top);
        EXPECT_EQ(exposure->image(1, 0), std::floor(3 + 0.625 * top + 0.5));
        EXPECT_EQ(exposure->image(2, 0), 3);
        EXPECT_EQ(exposure->saturated_fraction, 14.0 / 16);
        options.offset = -10;
        EXPECT_EQ(expose(line_integrals, carmOf(4), options)->image(2, 0), 0);
    }
}

TEST(XrayPhysics, ElectronicNoiseIsNormalAndAdds) {
    XrayOptions options = XrayOptions::ideal(1000);
    options.electronic_noise_photons = 20;
    options.quantum_noise = true;
    options.gain = 2;
    const auto exposure = expose(Image(256, 256), carmOf(256), options);
    ASSERT_OK(exposure);
    const double variance = 4 * (1000 + 400), n = 256.0 * 256.0;
    EXPECT_NEAR(statistics(exposure->image).variance, variance, 5 * variance * std::sqrt(2 / n));
    EXPECT_NEAR(statistics(exposure->image).mean, 2000, 5 * std::sqrt(variance / n));
}

TEST(XrayPhysics, AutomaticBrightnessBringsTheGeometricMeanToItsLevel) {
    XrayOptions options;
    options.bits = 16;
    const auto thin = expose(Image(64, 64, 0.5f), carmOf(64), options);
    const auto thick = expose(Image(64, 64, 4.5f), carmOf(64), options);
    ASSERT_OK(thin);
    ASSERT_OK(thick);
    EXPECT_NEAR(statistics(thin->image).mean, 0.25 * 65535, 0.005 * 65535);
    EXPECT_NEAR(statistics(thick->image).mean, 0.25 * 65535, 0.005 * 65535);
    EXPECT_GT(thick->gain, 20 * thin->gain);
}

TEST(XrayPhysics, SameSeedSamePictureOnAnyNumberOfThreads) {
    XrayOptions options;
    options.seed = 42;
    const auto first = expose(disc(200), carmOf(200), options);
    ASSERT_OK(first);
    {
        const ThreadLimit one(1);
        EXPECT_EQ(expose(disc(200), carmOf(200), options)->image, first->image);
    }
    options.seed = 43;
    EXPECT_NE(expose(disc(200), carmOf(200), options)->image, first->image);
}

TEST(XrayPhysics, RefusesWhatItCannotDo) {
    XrayOptions options;
    options.photons_per_pixel = -5;
    EXPECT_EQ(options.validate().error().message(),
              "photons_per_pixel: found -5, expected 0.001 to 1000000000 photons.");
    options = {};
    options.bits = 20;
    EXPECT_EQ(options.validate().error().where, "bits");
    options = {};
    options.glare_fraction = NAN;
    EXPECT_EQ(options.validate().error().where, "glare_fraction");
    options = {};
    options.detector_kernel = Image(2, 2, 1.0f);
    EXPECT_EQ(options.validate().error().where, "detector_kernel");
    options.detector_kernel = Image(3, 3, -1.0f);
    EXPECT_FALSE(options.validate().ok());
    options = {};
    options.object_depth_mm = 1200;
    EXPECT_EQ(expose(Image(8, 8), carmOf(8), options).error().where, "object_depth_mm");
    options = {};
    EXPECT_EQ(expose(Image(8, 8, NAN), carmOf(8), options).error().where, "line integrals");
    EXPECT_FALSE(expose(Image(8, 8, -1000), carmOf(8), options).ok());
    EXPECT_THROW((void)expose(Image(9, 8), carmOf(8), options), std::logic_error);
    EXPECT_OK(XrayOptions().validate());
    EXPECT_OK(XrayOptions::ideal().validate());
}

}  // namespace
}  // namespace fluorocut

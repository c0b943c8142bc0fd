#include "core/cavity/fit_covariance.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <stdexcept>
#include <vector>

#include <unsupported/Eigen/FFT>

#include "core/base/parallel.h"

namespace fluorocut::cavity {
namespace {

constexpr int kMostLag = 96;  // px

using Spectrum = Eigen::MatrixXcf;  // column by column: each an image row

// The next size that has no prime factor but 2, 3 and 5.
int fastSize(int least) {
    for (int n = least;; ++n) {
        int rest = n;
        for (const int prime : {2, 3, 5})
            while (rest % prime == 0)
                rest /= prime;
        if (rest == 1) return n;
    }
}

void transformColumns(Spectrum& values) {
    parallelFor(static_cast<std::size_t>(values.cols()), 32, [&](std::size_t begin, std::size_t end) {
        Eigen::FFT<float> fft;
        std::vector<std::complex<float>> in(static_cast<std::size_t>(values.rows())), out;
        for (std::size_t c = begin; c < end; ++c) {
            std::copy_n(values.col(static_cast<Eigen::Index>(c)).data(), in.size(), in.begin());
            fft.fwd(out, in);
            std::copy(out.begin(), out.end(), values.col(static_cast<Eigen::Index>(c)).data());
        }
    });
}

// Forward, unscaled. The result is transposed: the sum over all frequencies is what is asked of it.
Spectrum transformed(Spectrum values) {
    transformColumns(values);
    Spectrum turned = values.transpose();
    transformColumns(turned);
    return turned;
}

// Of a lag as a share of the largest.
double parzen(double share) {
    const double x = std::abs(share);
    if (x >= 1) return 0;
    return x < 0.5 ? 1 - 6 * x * x * (1 - x) : 2 * std::pow(1 - x, 3);
}

}  // namespace

Eigen::MatrixXd correlatedCovariance(const Eigen::MatrixXf& influence, const Eigen::VectorXf& residual, int width,
                                     int height) {
    if (influence.rows() != residual.size() || residual.size() != static_cast<Eigen::Index>(width) * height)
        throw std::logic_error("correlatedCovariance: sizes that do not belong together");
    const int lag_x = std::clamp(width / 3, 1, kMostLag), lag_y = std::clamp(height / 3, 1, kMostLag);
    const int columns = fastSize(width + lag_x), rows = fastSize(height + lag_y);
    const auto padded = [&](const auto& pixels) {
        Spectrum image = Spectrum::Zero(columns, rows);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                image(x, y) = pixels[static_cast<Eigen::Index>(y) * width + x];
        return image;
    };
    const double count = static_cast<double>(columns) * rows;
    // The autocovariance: the residual's power, back in space, per pair of pixels that far apart, within the window.
    // A second forward transform is the backward one of an even function.
    Spectrum power = transformed(padded(residual));
    power = power.cwiseAbs2().cast<std::complex<float>>();
    Spectrum covariance = transformed(power.transpose().eval()).transpose();  // columns x rows
    for (int y = 0; y < rows; ++y) {
        const int dy = std::min(y, rows - y);
        for (int x = 0; x < columns; ++x) {
            const int dx = std::min(x, columns - x);
            const double window = parzen(static_cast<double>(dx) / lag_x) * parzen(static_cast<double>(dy) / lag_y);
            const double pairs = std::max(1.0, static_cast<double>(width - dx)) * std::max(1, height - dy);
            const double value = window == 0 ? 0 : covariance(x, y).real() / count / pairs * window;
            covariance(x, y) = static_cast<float>(value);
        }
    }
    const Eigen::MatrixXf density = transformed(std::move(covariance)).real().cwiseMax(0.0f);
    const Eigen::Index unknowns = influence.cols();
    std::vector<Spectrum> spectra;
    for (Eigen::Index k = 0; k < unknowns; ++k)
        spectra.push_back(transformed(padded(influence.col(k))));
    Eigen::MatrixXd result(unknowns, unknowns);
    for (Eigen::Index k = 0; k < unknowns; ++k) {
        for (Eigen::Index l = 0; l <= k; ++l) {
            const auto product = (spectra[static_cast<std::size_t>(k)].array() *
                                  spectra[static_cast<std::size_t>(l)].array().conjugate())
                                     .real();
            result(k, l) = result(l, k) = (product.cast<double>() * density.array().cast<double>()).sum() / count;
        }
    }
    return result;
}

}  // namespace fluorocut::cavity

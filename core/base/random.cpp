#include "core/base/random.h"

#include <bit>
#include <cmath>
#include <stdexcept>

namespace fluorocut {
namespace {

std::uint64_t splitMix(std::uint64_t& state) {
    state += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed) : seed_(seed), spare_normal_(0) {
    std::uint64_t state = seed;
    for (auto& word : state_)
        word = splitMix(state);
}

Random Random::fork(std::uint64_t stream) const {
    std::uint64_t state = seed_;
    std::uint64_t mixed = splitMix(state) ^ (stream * 0xd1342543de82ef95u + 0x2545f4914f6cdd1du);
    return Random(splitMix(mixed));
}

std::uint64_t Random::bits() {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return result;
}

double Random::uniform() {
    return static_cast<double>(bits() >> 11) * 0x1.0p-53;
}

double Random::uniform(double low, double high) {
    return low + (high - low) * uniform();
}

double Random::normal() {
    if (has_spare_) {
        has_spare_ = false;
        return spare_normal_;
    }
    double u, v, s;
    do {  // Marsaglia's polar method
        u = uniform(-1, 1);
        v = uniform(-1, 1);
        s = u * u + v * v;
    } while (s >= 1 || s == 0);
    const double scale = std::sqrt(-2 * std::log(s) / s);
    spare_normal_ = v * scale;
    has_spare_ = true;
    return u * scale;
}

std::uint64_t Random::below(std::uint64_t limit) {
    if (limit == 0) throw std::logic_error("Random::below(0)");
    const std::uint64_t threshold = (0 - limit) % limit;
    std::uint64_t value;
    do {
        value = bits();
    } while (value < threshold);
    return value % limit;
}

std::uint64_t Random::poisson(double mean) {
    if (!(mean >= 0 && mean < 1e15)) throw std::logic_error("Random::poisson: mean outside [0, 1e15)");
    if (mean == 0) return 0;
    if (mean < 10) {
        const double limit = std::exp(-mean);
        double product = uniform();
        std::uint64_t k = 0;
        while (product > limit) {
            product *= uniform();
            ++k;
        }
        return k;
    }
    // W. Hormann, "The transformed rejection method for generating Poisson random variables", 1993, algorithm PTRS.
    const double b = 0.931 + 2.53 * std::sqrt(mean);
    const double a = -0.059 + 0.02483 * b;
    const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    const double v_r = 0.9277 - 3.6224 / (b - 2);
    const double log_mean = std::log(mean);
    while (true) {
        const double u = uniform() - 0.5;
        const double v = uniform();
        const double us = 0.5 - std::abs(u);
        const double k = std::floor((2 * a / us + b) * u + mean + 0.43);
        if (us >= 0.07 && v <= v_r) return static_cast<std::uint64_t>(k);
        if (k < 0 || (us < 0.013 && v > us)) continue;
        int sign;  // std::lgamma writes a global; this runs on many threads
        if (std::log(v) + std::log(inverse_alpha) - std::log(a / (us * us) + b) <=
            -mean + k * log_mean - ::lgamma_r(k + 1, &sign)) {
            return static_cast<std::uint64_t>(k);
        }
    }
}

}  // namespace fluorocut

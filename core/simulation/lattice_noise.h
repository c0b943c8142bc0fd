// Seeded smooth noise in space: random values on the integer lattice, interpolated with a smooth step (Perlin 1985,
// "value noise"). A function of the place alone, so it is the same whatever the voxels and the number of threads.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/geometry/rigid3.h"

namespace fluorocut {

class LatticeNoise {
  public:
    explicit LatticeNoise(std::uint64_t seed) : seed_(mix(seed + 0x9e3779b97f4a7c15u)) {}

    // In [-1, 1], mean 0, with features about one unit of `p` in size.
    double operator()(const Vector3& p) const {
        const double fx = std::floor(p.x()), fy = std::floor(p.y()), fz = std::floor(p.z());
        const auto ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy),
                   iz = static_cast<std::int64_t>(fz);
        const double u = fade(p.x() - fx), v = fade(p.y() - fy), w = fade(p.z() - fz);
        const auto edge = [&](std::int64_t j, std::int64_t k) {
            const double a = value(ix, iy + j, iz + k);
            return a + u * (value(ix + 1, iy + j, iz + k) - a);
        };
        const double c00 = edge(0, 0), c10 = edge(1, 0), c01 = edge(0, 1), c11 = edge(1, 1);
        const double c0 = c00 + v * (c10 - c00), c1 = c01 + v * (c11 - c01);
        return c0 + w * (c1 - c0);
    }

  private:
    static double fade(double t) { return t * t * (3 - 2 * t); }
    static std::uint64_t mix(std::uint64_t z) {  // splitmix64's finaliser (Steele, Lea and Flood 2014)
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    double value(std::int64_t i, std::int64_t j, std::int64_t k) const {
        const std::uint64_t bits = mix(seed_ ^ (static_cast<std::uint64_t>(i) * 0x8da6b343u) ^
                                       (static_cast<std::uint64_t>(j) * 0xd8163841u << 16) ^
                                       (static_cast<std::uint64_t>(k) * 0xcb1ab31fu << 32));
        return static_cast<double>(bits >> 11) * 0x1p-52 - 1;
    }

    std::uint64_t seed_;
};

}  // namespace fluorocut

// Seeded random numbers that are the same on every machine and compiler.
//
// The standard library's engines are portable, its distributions are not; these are. Work that runs in parallel takes
// one stream per row or per item with `fork`, so that results do not depend on the number of threads.
#pragma once

#include <array>
#include <cstdint>

namespace fluorocut {

class Random {
  public:
    explicit Random(std::uint64_t seed);

    // An independent stream named by a number: the same (seed, stream) gives the same numbers.
    Random fork(std::uint64_t stream) const;

    std::uint64_t bits();                      // 64 uniform bits (xoshiro256++, Blackman and Vigna 2019)
    double uniform();                          // [0, 1)
    double uniform(double low, double high);   // [low, high)
    double normal();                           // mean 0, standard deviation 1
    std::uint64_t poisson(double mean);        // exact at every mean (inversion below 10, Hormann's PTRS above)
    std::uint64_t below(std::uint64_t limit);  // [0, limit), unbiased

  private:
    std::uint64_t seed_;
    std::array<std::uint64_t, 4> state_;
    double spare_normal_;
    bool has_spare_ = false;
};

}  // namespace fluorocut

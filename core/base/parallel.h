// Data-parallel loops over a range, on all cores. Results must not depend on how the range is split: write to disjoint
// places, and never add floating-point numbers across pieces in the order they happen to finish.
#pragma once

#include <cstddef>
#include <functional>

namespace fluorocut {

// Calls body(begin, end) for pieces that together cover [0, count), each at most `grain` long, and returns when all are
// done. The first exception thrown by a piece is rethrown. May be nested and called from any thread.
void parallelFor(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body);

// Number of threads that parallelFor uses.
int parallelThreads();

// Limits parallelFor to `threads` for the lifetime of the object (tests of independence from the thread count).
class ThreadLimit {
  public:
    explicit ThreadLimit(int threads);
    ~ThreadLimit();
    ThreadLimit(const ThreadLimit&) = delete;
    ThreadLimit& operator=(const ThreadLimit&) = delete;

  private:
    void* control_;
};

}  // namespace fluorocut

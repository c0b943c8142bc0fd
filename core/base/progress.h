// Progress: how long work tells where it stands and learns that it should stop.
//
// A stage calls `report` and asks `isCancelled` at least every 100 ms, from the thread that runs the stage. It returns
// cancelled(...) as soon as it is asked to. Fractions are in [0, 1] and do not go back.
#pragma once

#include <string_view>

namespace fluorocut {

class Progress {
  public:
    virtual ~Progress() = default;
    virtual void report(double fraction, std::string_view label) = 0;
    virtual bool isCancelled() const = 0;

    // For callers that neither show progress nor cancel.
    static Progress& none();
};

// The part [begin, end] of a parent's range, so that a stage made of stages reports one fraction.
class SubProgress final : public Progress {
  public:
    SubProgress(Progress& parent, double begin, double end) : parent_(parent), begin_(begin), end_(end) {}
    void report(double fraction, std::string_view label) override {
        parent_.report(begin_ + fraction * (end_ - begin_), label);
    }
    bool isCancelled() const override { return parent_.isCancelled(); }

  private:
    Progress& parent_;
    double begin_;
    double end_;
};

}  // namespace fluorocut

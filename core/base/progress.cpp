#include "core/base/progress.h"

namespace fluorocut {
namespace {

class NoProgress final : public Progress {
  public:
    void report(double, std::string_view) override {}
    bool isCancelled() const override { return false; }
};

}  // namespace

Progress& Progress::none() {
    static NoProgress instance;
    return instance;
}

}  // namespace fluorocut

// Progress on a terminal: one line on stderr, redrawn at most ten times a second, gone when the work is done. Nothing
// where stderr is not a terminal. Ctrl-C (SIGINT) and SIGTERM ask the work to stop; a second one ends the program.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "core/base/progress.h"

namespace fluorocut::cli {

class ProgressBar final : public Progress {
  public:
    ProgressBar();
    ~ProgressBar() override;
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;

    void report(double fraction, std::string_view label) override;
    bool isCancelled() const override;
    // Takes the line away.
    void clear();

  private:
    std::mutex mutex_;
    bool terminal_;
    bool drawn_ = false;
    std::chrono::steady_clock::time_point last_;
};

}  // namespace fluorocut::cli

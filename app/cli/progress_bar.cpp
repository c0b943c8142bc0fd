#include "app/cli/progress_bar.h"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

namespace fluorocut::cli {
namespace {

volatile std::sig_atomic_t g_stop_asked = 0;

void askToStop(int) {
    g_stop_asked = 1;
}

void handleOnce(int signal) {
    struct sigaction action {};
    action.sa_handler = askToStop;
    action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second one has its usual effect
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
}

}  // namespace

ProgressBar::ProgressBar() : terminal_(isatty(STDERR_FILENO) == 1) {
    handleOnce(SIGINT);
    handleOnce(SIGTERM);
}

ProgressBar::~ProgressBar() {
    clear();
}

void ProgressBar::report(double fraction, std::string_view label) {
    if (!terminal_) return;
    const std::scoped_lock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (drawn_ && now - last_ < std::chrono::milliseconds(100)) return;
    constexpr int kCells = 30;
    const double part = std::clamp(fraction, 0.0, 1.0);
    const int full = static_cast<int>(part * kCells);
    fmt::print(stderr, "\r\x1b[K[{:=<{}}{: <{}}] {:3.0f} %  {}", "", full, "", kCells - full, 100 * part, label);
    std::fflush(stderr);
    drawn_ = true;
    last_ = now;
}

bool ProgressBar::isCancelled() const {
    return g_stop_asked != 0;
}

void ProgressBar::clear() {
    const std::scoped_lock lock(mutex_);
    if (!drawn_) return;
    fmt::print(stderr, "\r\x1b[K");
    std::fflush(stderr);
    drawn_ = false;
}

}  // namespace fluorocut::cli

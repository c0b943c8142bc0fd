#include "ui/session/job_runner.h"

#include <QMetaObject>
#include <QString>
#include <chrono>
#include <mutex>
#include <stdexcept>

namespace fluorocut::ui {

// Passes on at most 30 reports a second: the screen cannot show more, and the event queue must not fill.
class JobRunner::Reporter final : public Progress {
  public:
    Reporter(JobRunner& runner, std::shared_ptr<const std::atomic<bool>> cancelled)
        : runner_(runner), cancelled_(std::move(cancelled)) {}

    void report(double fraction, std::string_view label) override {
        const std::scoped_lock lock(mutex_);
        const auto now = std::chrono::steady_clock::now();
        if (now - last_ < std::chrono::milliseconds(33)) return;
        last_ = now;
        const QString text = QString::fromUtf8(label.data(), static_cast<int>(label.size()));
        QMetaObject::invokeMethod(
            &runner_, [this_runner = &runner_, fraction, text] { emit this_runner->progressed(fraction, text); },
            Qt::QueuedConnection);
    }
    bool isCancelled() const override { return *cancelled_; }

  private:
    JobRunner& runner_;
    std::shared_ptr<const std::atomic<bool>> cancelled_;
    std::mutex mutex_;
    std::chrono::steady_clock::time_point last_;
};

JobRunner::JobRunner(QObject* parent) : QObject(parent) {}

JobRunner::~JobRunner() {
    cancel();
    if (thread_.joinable()) thread_.join();
}

void JobRunner::cancel() {
    if (cancelled_) *cancelled_ = true;
}

void JobRunner::start(Work work) {
    if (busy_) throw std::logic_error("JobRunner: a job is running already");
    if (thread_.joinable()) thread_.join();  // it is done: it only had to hand over its result
    busy_ = true;
    cancelled_ = std::make_shared<std::atomic<bool>>(false);
    thread_ = std::thread([this, work = std::move(work), cancelled = cancelled_] {
        Reporter reporter(*this, cancelled);
        std::function<void()> continuation;
        try {
            continuation = work(reporter);
        } catch (const std::exception& bug) {
            continuation = [this, what = QString::fromUtf8(bug.what())] { emit crashed(what); };
        }
        QMetaObject::invokeMethod(
            this, [this, continuation] { finish(continuation); }, Qt::QueuedConnection);
    });
}

void JobRunner::finish(const std::function<void()>& continuation) {
    busy_ = false;  // before: the continuation may start the next job
    continuation();
}

}  // namespace fluorocut::ui

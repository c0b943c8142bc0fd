// JobRunner: one piece of long work at a time on a thread of its own. The GUI thread never waits for it.
//
//     runner.run<Volume>([](Progress& progress) { return makeFemurPhantom({}, progress); },
//                        [this](Result<Volume> volume) { show(volume); });  // on the JobRunner's thread
//
// The work must own what it reads. An exception in it (our bug) arrives as the signal `crashed`. Destruction cancels
// the work and waits for it to notice.
#pragma once

#include <QObject>
#include <atomic>
#include <functional>
#include <memory>
#include <thread>

#include "core/base/progress.h"
#include "core/base/result.h"

namespace fluorocut::ui {

class JobRunner : public QObject {
    Q_OBJECT

  public:
    explicit JobRunner(QObject* parent = nullptr);
    ~JobRunner() override;

    bool isBusy() const { return busy_; }
    void cancel();

    // Throws std::logic_error while another job runs.
    template <class T>
    void run(std::function<Result<T>(Progress&)> work, std::function<void(Result<T>)> done) {
        start([work = std::move(work), done = std::move(done)](Progress& progress) -> std::function<void()> {
            auto result = std::make_shared<Result<T>>(work(progress));
            return [result, done] { done(std::move(*result)); };
        });
    }

  signals:
    void progressed(double fraction, const QString& label);
    void crashed(const QString& what);

  private:
    // Runs on the worker; what it returns runs on the JobRunner's thread.
    using Work = std::function<std::function<void()>(Progress&)>;
    class Reporter;

    void start(Work work);
    void finish(const std::function<void()>& continuation);

    std::thread thread_;
    std::shared_ptr<std::atomic<bool>> cancelled_;
    bool busy_ = false;
};

}  // namespace fluorocut::ui

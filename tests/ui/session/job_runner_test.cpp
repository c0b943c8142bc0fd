#include "ui/session/job_runner.h"

#include <QCoreApplication>
#include <QSignalSpy>
#include <QTest>
#include <chrono>

#include <gtest/gtest.h>

namespace fluorocut::ui {
namespace {

using namespace std::chrono_literals;

TEST(JobRunner, WorksElsewhereAndHandsOverHere) {
    JobRunner runner;
    std::thread::id worker;
    std::thread::id receiver;
    int value = 0;
    runner.run<int>(
        [&](Progress&) -> Result<int> {
            worker = std::this_thread::get_id();
            return 42;
        },
        [&](Result<int> result) {
            receiver = std::this_thread::get_id();
            value = *result;
        });
    EXPECT_TRUE(runner.isBusy());
    EXPECT_EQ(value, 0);  // nothing arrives before the event loop turns
    ASSERT_TRUE(QTest::qWaitFor([&] { return value == 42; }));
    EXPECT_NE(worker, std::this_thread::get_id());
    EXPECT_EQ(receiver, std::this_thread::get_id());
    EXPECT_FALSE(runner.isBusy());
}

TEST(JobRunner, TheEventLoopTurnsWhileItWorks) {
    JobRunner runner;
    const QSignalSpy reports(&runner, &JobRunner::progressed);
    bool done = false;
    runner.run<int>(
        [](Progress& progress) -> Result<int> {
            for (int i = 0; i < 10; ++i) {
                progress.report(i / 10.0, "slice");
                std::this_thread::sleep_for(40ms);
            }
            return 1;
        },
        [&](Result<int>) { done = true; });
    ASSERT_TRUE(QTest::qWaitFor([&] { return reports.count() >= 3; }));
    EXPECT_FALSE(done);
    EXPECT_EQ(reports.at(0).at(1).toString(), "slice");
    ASSERT_TRUE(QTest::qWaitFor([&] { return done; }));
}

TEST(JobRunner, CancellingReachesTheWork) {
    JobRunner runner;
    std::optional<Error> error;
    runner.run<int>(
        [](Progress& progress) -> Result<int> {
            while (!progress.isCancelled())
                std::this_thread::sleep_for(5ms);
            return cancelled("the test");
        },
        [&](Result<int> result) { error = result.error(); });
    runner.cancel();
    ASSERT_TRUE(QTest::qWaitFor([&] { return error.has_value(); }));
    EXPECT_TRUE(error->isCancelled());
}

TEST(JobRunner, DestructionCancelsAndWaits) {
    std::atomic<bool> left = false;
    {
        JobRunner runner;
        runner.run<int>(
            [&](Progress& progress) -> Result<int> {
                while (!progress.isCancelled())
                    std::this_thread::sleep_for(5ms);
                left = true;
                return 1;
            },
            [](Result<int>) { FAIL() << "handed over to an object that is gone"; });
    }
    EXPECT_TRUE(left);
    QCoreApplication::processEvents();
}

TEST(JobRunner, AnExceptionInTheWorkArrivesAsASentence) {
    JobRunner runner;
    const QSignalSpy crashed(&runner, &JobRunner::crashed);
    runner.run<int>([](Progress&) -> Result<int> { throw std::logic_error("size does not match"); },
                    [](Result<int>) { FAIL() << "there is no result"; });
    ASSERT_TRUE(QTest::qWaitFor([&] { return crashed.count() == 1; }));
    EXPECT_EQ(crashed.at(0).at(0).toString(), "size does not match");
    EXPECT_FALSE(runner.isBusy());
}

TEST(JobRunner, RunsOneJobAtATimeAndTheNextAfterIt) {
    JobRunner runner;
    int sum = 0;
    const auto one = [](Progress&) -> Result<int> { return 1; };
    runner.run<int>(one, [&](Result<int> first) {
        sum += *first;
        runner.run<int>(one, [&](Result<int> second) { sum += *second; });
    });
    EXPECT_THROW(runner.run<int>(one, [](Result<int>) {}), std::logic_error);
    ASSERT_TRUE(QTest::qWaitFor([&] { return sum == 2; }));
}

}  // namespace
}  // namespace fluorocut::ui

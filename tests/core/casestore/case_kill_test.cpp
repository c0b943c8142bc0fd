// What was acknowledged survives kill -9.
#include <csignal>
#include <cstdio>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/random.h"
#include "core/casestore/case_store.h"
#include "tests/core/casestore/case_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

constexpr int kKills = 200;

// The child: numbered steps, each with content of its own, as fast as they go; each number down the pipe once the case
// has said that it is safe. Nothing but the kill ends it.
[[noreturn]] void writeSteps(const std::filesystem::path& path, int pipe, int first) {
    Result<CaseStore> store = CaseStore::open(path, CaseStore::Access::write);
    if (!store) ::_exit(2);
    for (int number = first;; ++number) {
        const std::string text = std::to_string(number);
        const auto item = store->addItem({.schema = "test/number/1", .file_name = text + ".json"},
                                         text + std::string(static_cast<std::size_t>(number % 7) * 3000, ' '));
        if (!item) ::_exit(3);
        Step step = test::stepOf("step " + text, item->hash, item->hash);
        if (!store->addStep(step)) ::_exit(4);
        if (::write(pipe, &number, sizeof number) != sizeof number) ::_exit(5);
    }
}

TEST(CaseKillTest, SlowAcknowledgedStepsSurviveKillAtRandomMoments) {
    const test::ScratchFolder scratch;
    const std::filesystem::path path = scratch / "killed.fluorocut";
    ASSERT_OK(CaseStore::create(path, "killed"));
    Random random(20260301);
    int next = 0, acknowledged = 0, unacknowledged = 0, killed_before_the_first = 0;
    for (int kill = 0; kill < kKills; ++kill) {
        int ends[2];
        ASSERT_EQ(::pipe(ends), 0);
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            ::close(ends[0]);
            writeSteps(path, ends[1], next);
        }
        ::close(ends[1]);
        // A quarter at any moment from its start, in the opening too; the others some time after a step of theirs.
        int newest = next - 1;
        const int steps_first = random.below(4) == 0 ? 0 : 1 + static_cast<int>(random.below(2));
        for (int i = 0; i < steps_first; ++i)
            ASSERT_EQ(::read(ends[0], &newest, sizeof newest), static_cast<ssize_t>(sizeof newest)) << "kill " << kill;
        ::usleep(static_cast<useconds_t>(random.below(25000)));  // about one step: two commits with their fsync
        ASSERT_EQ(::kill(child, SIGKILL), 0);
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFSIGNALED(status)) << "the child failed by itself, at " << WEXITSTATUS(status);
        while (::read(ends[0], &newest, sizeof newest) == static_cast<ssize_t>(sizeof newest)) {
        }
        ::close(ends[0]);
        acknowledged += newest - next + 1;
        killed_before_the_first += newest < next ? 1 : 0;

        const Result<CaseStore> store = CaseStore::open(path, CaseStore::Access::read);
        ASSERT_OK(store);
        const Result<CaseContent> content = store->content();
        ASSERT_OK(content);
        // Every acknowledged one, in order; at most one more that was safe before it could be told.
        const int held = static_cast<int>(content->steps.size());
        ASSERT_GE(held, newest + 1) << "kill " << kill;
        ASSERT_LE(held, newest + 2) << "kill " << kill;
        for (int number = next; number < held; ++number) {
            const Step& step = content->steps[static_cast<std::size_t>(number)];
            ASSERT_EQ(step.name, "step " + std::to_string(number));
            const Result<std::string> bytes = store->bytes(step.result);
            ASSERT_OK(bytes);
            ASSERT_EQ(std::stoi(*bytes), number);
        }
        const Result<CaseCheck> check = store->verify({}, Progress::none());
        ASSERT_OK(check);
        ASSERT_TRUE(check->whole()) << "kill " << kill << ": " << check->fault->what;
        unacknowledged += held - newest - 1;
        next = held;
    }
    std::printf("%d steps acknowledged, %d safe but untold, %d kills before the first step\n", acknowledged,
                unacknowledged, killed_before_the_first);
    EXPECT_GE(acknowledged, kKills / 2);  // it was killed at work, not while it slept
    EXPECT_GT(killed_before_the_first, 0);
}

}  // namespace
}  // namespace fluorocut

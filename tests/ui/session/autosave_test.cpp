// Autosave: in order, without making the hand wait, and safe against kill -9.
#include "ui/session/autosave.h"

#include <QElapsedTimer>
#include <QSignalSpy>
#include <QTest>
#include <fstream>

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/fixtures.h"
#include "tests/ui/session/full_case.h"

namespace fluorocut::ui {
namespace {

CaseState moved(const Session& session, double mm) {
    CaseState next = *session.committed();
    next.plan.femur_from_implant = Rigid3::fromTranslation({mm, 0, 0});
    return next;
}

double placeIn(const std::filesystem::path& file) {
    const Result<CaseState> read = readCase(file);
    EXPECT_OK(read);
    return read ? read->plan.femur_from_implant.translation().x() : -1;
}

class AutosaveTest : public testing::Test {
  protected:
    void waitFor(const Autosave& autosave) {
        ASSERT_TRUE(QTest::qWaitFor([&] { return autosave.pending() == 0; }, 20000));
    }

    test::ScratchFolder scratch_;
    Session session_;
};

TEST_F(AutosaveTest, OpeningWritesNothingTheFirstEditAFileOfItsOwn) {
    Autosave autosave(session_, scratch_ / "cases");
    session_.open(test::fullCase());
    EXPECT_TRUE(autosave.file().empty());
    session_.commit("Move", moved(session_, 1));
    waitFor(autosave);
    ASSERT_FALSE(autosave.file().empty());
    EXPECT_EQ(autosave.file().parent_path(), scratch_ / "cases");
    EXPECT_EQ(placeIn(autosave.file()), 1);
    const auto first = autosave.file();
    session_.open(test::fullCase());
    session_.commit("Move", moved(session_, 2));
    waitFor(autosave);
    EXPECT_NE(autosave.file(), first);
    EXPECT_EQ(placeIn(first), 1);
    EXPECT_EQ(placeIn(autosave.file()), 2);
}

TEST_F(AutosaveTest, WritesEveryEditInOrderUndoingToo) {
    Autosave autosave(session_, scratch_.path());
    QSignalSpy saved(&autosave, &Autosave::saved);
    session_.open(test::fullCase());
    for (int i = 1; i <= 20; ++i)
        session_.commit("Move", moved(session_, i));
    session_.undo();
    waitFor(autosave);
    ASSERT_EQ(saved.count(), 21);
    for (int i = 0; i < saved.count(); ++i)
        EXPECT_EQ(saved.at(i).at(0).toLongLong(), i + 1);
    EXPECT_EQ(placeIn(autosave.file()), 19);
    const auto store = CaseStore::open(autosave.file(), CaseStore::Access::read);
    ASSERT_OK(store);
    std::size_t documents = 0;
    const Result<CaseContent> content = store->content();
    for (const Item& item : content->items)
        documents += item.schema == "fluorocut/desktop/1" ? 1 : 0;
    EXPECT_EQ(documents, 21u);
    const auto check = store->verify({}, Progress::none());
    ASSERT_OK(check);
    EXPECT_TRUE(check->whole());
}

TEST_F(AutosaveTest, GoesOnInTheFileOfAnOpenedCase) {
    const auto file = scratch_ / "hip.fluorocut";
    ASSERT_OK(writeCase(file, test::fullCase()));
    Autosave autosave(session_, scratch_ / "cases");
    session_.open(*readCase(file));
    autosave.goOnIn(file);
    session_.commit("Move", moved(session_, 3));
    waitFor(autosave);
    EXPECT_EQ(placeIn(file), 3);
    EXPECT_FALSE(std::filesystem::exists(scratch_ / "cases"));
}

TEST_F(AutosaveTest, SaveAsLeavesTheOldFileAndGoesOnInTheNewOne) {
    Autosave autosave(session_, scratch_ / "cases");
    session_.open(test::fullCase());
    session_.commit("Move", moved(session_, 1));
    const auto old = autosave.file();
    autosave.saveAs(scratch_ / "copy.fluorocut");
    session_.commit("Move", moved(session_, 2));
    waitFor(autosave);
    EXPECT_EQ(placeIn(old), 1);
    EXPECT_EQ(placeIn(scratch_ / "copy.fluorocut"), 2);
}

TEST_F(AutosaveTest, APreviewIsNotSaved) {
    Autosave autosave(session_, scratch_.path());
    session_.preview(moved(session_, 1));
    session_.dropPreview();
    EXPECT_EQ(autosave.pending(), 0);
}

TEST_F(AutosaveTest, AFolderThatTakesNothingIsASentenceAndTheNextEditIsTriedAgain) {
    std::ofstream(scratch_ / "cases") << "a file where a folder should be";
    Autosave autosave(session_, scratch_ / "cases");
    QSignalSpy failed(&autosave, &Autosave::failed);
    session_.commit("Move", moved(session_, 1));
    ASSERT_TRUE(failed.wait(20000));
    EXPECT_TRUE(failed.at(0).at(0).toString().contains("cases"));
    std::filesystem::remove(scratch_ / "cases");
    session_.commit("Move", moved(session_, 2));
    waitFor(autosave);
    EXPECT_EQ(failed.count(), 1);
    EXPECT_EQ(placeIn(autosave.file()), 2);
}

TEST_F(AutosaveTest, TheHandDoesNotWaitForALargeCase) {
    CaseState state = test::fullCase();
    VolumeGrid grid;
    grid.size = {200, 200, 200};  // 32 MB
    state.ct = std::make_shared<const Volume>(grid, 5.0F);
    session_.open(state);
    Autosave autosave(session_, scratch_.path());
    QElapsedTimer timer;
    timer.start();
    session_.commit("Move", moved(session_, 1));
    // Handing over a pointer takes microseconds; writing 32 MB to a disk takes 50 ms at the very least.
    EXPECT_LT(timer.elapsed(), 25);
    EXPECT_EQ(autosave.pending(), 1);
    waitFor(autosave);
}

TEST_F(AutosaveTest, WhatWasHandedOverIsOnTheDiskWhenItIsDestroyed) {
    std::filesystem::path file;
    {
        Autosave autosave(session_, scratch_.path());
        for (int i = 1; i <= 5; ++i)
            session_.commit("Move", moved(session_, i));
        file = autosave.file();
    }
    EXPECT_EQ(placeIn(file), 5);
}

// A program of its own that edits until it is killed, and says into a pipe what it was told is saved.
[[noreturn]] void editForEver(const std::filesystem::path& folder, int pipe) {
    Session session;
    Autosave autosave(session, folder);
    session.open(test::fullCase());
    QObject::connect(&autosave, &Autosave::saved, [pipe](qint64 edits) {
        if (write(pipe, &edits, sizeof edits) != sizeof edits) _exit(1);
    });
    for (int i = 1;; ++i) {
        session.commit("Move", moved(session, i));
        QTest::qWait(1);
    }
}

TEST(AutosaveKill, SlowKillLosesNothingThatWasAcknowledged) {
    for (const int after_ms : {150, 400, 700}) {
        const test::ScratchFolder scratch;
        int pipe_ends[2];
        ASSERT_EQ(pipe(pipe_ends), 0);
        const pid_t child = fork();
        if (child == 0) {
            close(pipe_ends[0]);
            editForEver(scratch.path(), pipe_ends[1]);
        }
        close(pipe_ends[1]);
        qint64 acknowledged = 0, next = 0;
        QElapsedTimer timer;
        timer.start();
        while (read(pipe_ends[0], &next, sizeof next) == sizeof next) {
            acknowledged = next;
            if (timer.elapsed() > after_ms) kill(child, SIGKILL);
        }
        close(pipe_ends[0]);
        int status = 0;
        ASSERT_EQ(waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFSIGNALED(status));
        ASSERT_GT(acknowledged, 0);
        std::filesystem::path file;
        for (const auto& entry : std::filesystem::directory_iterator(scratch.path()))
            if (entry.path().extension() == ".fluorocut") file = entry.path();
        // The edit that was being written may be there as well.
        EXPECT_GE(placeIn(file), static_cast<double>(acknowledged)) << after_ms;
    }
}

}  // namespace
}  // namespace fluorocut::ui

#include "ui/session/session.h"

#include <QSignalSpy>

#include <gtest/gtest.h>

namespace fluorocut::ui {
namespace {

CaseState withPatient(const Session& session, const std::string& name) {
    CaseState next = *session.state();
    next.patient = name;
    return next;
}

TEST(Session, BeginsWithAnEmptyCaseAndNothingToUndo) {
    Session session;
    EXPECT_TRUE(session.state()->views.empty());
    EXPECT_FALSE(session.canUndo());
    session.undo();
    session.redo();
    EXPECT_FALSE(session.canRedo());
}

TEST(Session, UndoesAndRedoesMoreThanTwoHundredSteps) {
    Session session;
    for (int i = 1; i <= 300; ++i)
        session.commit(QString::number(i), withPatient(session, std::to_string(i)));
    for (int i = 300; i > 1; --i) {
        EXPECT_EQ(session.undoText(), QString::number(i));
        session.undo();
        EXPECT_EQ(session.state()->patient, std::to_string(i - 1));
    }
    for (int i = 2; i <= 300; ++i) {
        EXPECT_EQ(session.redoText(), QString::number(i));
        session.redo();
        EXPECT_EQ(session.state()->patient, std::to_string(i));
    }
}

TEST(Session, AnEditForgetsWhatHadBeenUndone) {
    Session session;
    session.commit("a", withPatient(session, "a"));
    session.commit("b", withPatient(session, "b"));
    session.undo();
    session.commit("c", withPatient(session, "c"));
    EXPECT_FALSE(session.canRedo());
    session.undo();
    EXPECT_EQ(session.state()->patient, "a");
}

TEST(Session, APreviewIsShownAndNotKept) {
    Session session;
    session.commit("a", withPatient(session, "a"));
    const QSignalSpy changed(&session, &Session::changed), saved(&session, &Session::committedTo);
    session.preview(withPatient(session, "moving"));
    EXPECT_EQ(session.state()->patient, "moving");
    EXPECT_EQ(session.committed()->patient, "a");
    EXPECT_EQ(saved.count(), 0);
    session.dropPreview();
    EXPECT_EQ(session.state()->patient, "a");
    EXPECT_EQ(changed.count(), 2);

    session.preview(withPatient(session, "moving"));
    session.undo();  // of the movement, not of the edit before it
    EXPECT_EQ(session.state()->patient, "a");
    session.preview(withPatient(session, "moving"));
    session.commit("moved", withPatient(session, "moved"));
    EXPECT_FALSE(session.isPreviewing());
    session.undo();
    EXPECT_EQ(session.state()->patient, "a");
}

TEST(Session, StatesShareWhatAnEditDoesNotTouch) {
    Session session;
    CaseState first;
    first.views.resize(1);
    first.views[0].before.image = std::make_shared<const Image>(64, 64);
    session.open(first);
    session.commit("a", withPatient(session, "a"));
    EXPECT_EQ(session.state()->views[0].before.image, first.views[0].before.image);
}

TEST(Session, KeepsNoMoreThanItsLimitAndGoesOn) {
    Session session;
    for (std::size_t i = 0; i < Session::kMostSteps + 50; ++i)
        session.commit("step", withPatient(session, std::to_string(i)));
    std::size_t undone = 0;
    for (; session.canUndo(); ++undone)
        session.undo();
    EXPECT_EQ(undone, Session::kMostSteps);
    EXPECT_EQ(session.state()->patient, "49");
}

TEST(Session, AnotherCaseHasNoHistory) {
    Session session;
    session.commit("a", withPatient(session, "a"));
    const QSignalSpy changed(&session, &Session::changed);
    session.open(CaseState{});
    EXPECT_FALSE(session.canUndo());
    EXPECT_EQ(changed.count(), 1);
}

}  // namespace
}  // namespace fluorocut::ui

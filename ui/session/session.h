// Session: the case that is being worked on, with what was before and after it.
//
//     session.commit(tr("Move implant"), next);    // an edit: one step to undo
//     session.preview(next);                       // while the hand moves: shown, not kept; commit or drop ends it
//
// Everybody who shows something reads state() when changed() says so. What follows from the state (a predicted image)
// is worked out from it anew; nothing is ever told what in it has changed.
#pragma once

#include <QObject>
#include <QString>
#include <memory>
#include <vector>

#include "ui/session/case_state.h"

namespace fluorocut::ui {

class Session : public QObject {
    Q_OBJECT

  public:
    using State = std::shared_ptr<const CaseState>;
    static constexpr std::size_t kMostSteps = 1000;  // to undo

    explicit Session(QObject* parent = nullptr);

    // Another case: nothing to undo.
    void open(CaseState state);

    // What is to be shown: the preview while there is one.
    const State& state() const { return preview_ ? preview_ : steps_[now_].state; }
    const State& committed() const { return steps_[now_].state; }
    bool isPreviewing() const { return preview_ != nullptr; }

    // `what` is what undoing it would be called: "Move implant". What had been undone is forgotten.
    void commit(const QString& what, CaseState next);
    void preview(CaseState next);
    void dropPreview();

    bool canUndo() const { return now_ > 0; }
    bool canRedo() const { return now_ + 1 < steps_.size(); }
    QString undoText() const { return canUndo() ? steps_[now_].what : QString(); }
    QString redoText() const { return canRedo() ? steps_[now_ + 1].what : QString(); }
    // Without anything to undo or redo they do nothing. A preview is dropped first, and that is all.
    void undo();
    void redo();

  signals:
    void opened();       // another case; changed() follows
    void changed();      // state() is another one
    void committedTo();  // by an edit, or its undoing, committed() is another one: to be saved

  private:
    struct Step {
        QString what;  // that led here
        State state;
    };

    void goTo(std::size_t step);

    std::vector<Step> steps_;
    std::size_t now_ = 0;
    State preview_;
};

}  // namespace fluorocut::ui

#include "ui/session/session.h"

#include <utility>

namespace fluorocut::ui {

Session::Session(QObject* parent) : QObject(parent), steps_{{QString(), std::make_shared<const CaseState>()}} {}

void Session::open(CaseState state) {
    preview_.reset();
    steps_ = {{QString(), std::make_shared<const CaseState>(std::move(state))}};
    now_ = 0;
    emit opened();
    emit changed();
}

void Session::commit(const QString& what, CaseState next) {
    preview_.reset();
    steps_.resize(now_ + 1);
    steps_.push_back({what, std::make_shared<const CaseState>(std::move(next))});
    if (steps_.size() > kMostSteps + 1) steps_.erase(steps_.begin());
    goTo(steps_.size() - 1);
}

void Session::preview(CaseState next) {
    preview_ = std::make_shared<const CaseState>(std::move(next));
    emit changed();
}

void Session::dropPreview() {
    if (!preview_) return;
    preview_.reset();
    emit changed();
}

void Session::undo() {
    if (preview_)
        dropPreview();
    else if (canUndo())
        goTo(now_ - 1);
}

void Session::redo() {
    if (preview_)
        dropPreview();
    else if (canRedo())
        goTo(now_ + 1);
}

void Session::goTo(std::size_t step) {
    now_ = step;
    emit changed();
    emit committedTo();
}

}  // namespace fluorocut::ui

#include "ui/panels/number_field.h"

#include <QDoubleSpinBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QSignalBlocker>
#include <QVBoxLayout>
#include <QWheelEvent>
#include <algorithm>

#include "ui/panels/section.h"

namespace fluorocut::ui {
namespace {

// A wheel that scrolls the inspector must not change the numbers it passes.
class CalmBox final : public QDoubleSpinBox {
  public:
    using QDoubleSpinBox::QDoubleSpinBox;

  protected:
    void wheelEvent(QWheelEvent* event) override {
        if (hasFocus())
            QDoubleSpinBox::wheelEvent(event);
        else
            event->ignore();
    }
};

}  // namespace

NumberField::NumberField(const QString& name, QWidget* parent) : QWidget(parent) {
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(0, 0, 0, 0);
    column->setSpacing(1);
    auto* row = new QHBoxLayout;
    auto* label = new QLabel(name, this);
    box_ = new CalmBox(this);
    box_->setKeyboardTracking(false);  // not every digit is an edit
    box_->setFocusPolicy(Qt::StrongFocus);
    box_->setAlignment(Qt::AlignRight);
    box_->setAccessibleName(name);
    label->setBuddy(box_);
    row->addWidget(label, 1);
    row->addWidget(box_);
    column->addLayout(row);
    problem_ = new QLabel(this);
    problem_->setWordWrap(true);
    problem_->hide();
    column->addWidget(problem_);
    connect(box_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, [this](double value) {
        state_.value = value;
        emit edited(value);
    });
}

void NumberField::show(const NumberState& state) {
    if (state == state_ && box_->suffix() == state.unit) return;
    state_ = state;
    const QSignalBlocker quiet(box_);
    box_->setDecimals(state.decimals);
    // A value that is out of its limits is shown as it is, and said to be so.
    box_->setRange(std::min(state.low, state.value), std::max(state.high, state.value));
    box_->setSingleStep(state.step);
    box_->setSuffix(state.unit);
    // One below the other, all are equally wide.
    box_->setMinimumWidth(box_->fontMetrics().horizontalAdvance(QStringLiteral("-100.00 mm")) +
                          2 * box_->fontMetrics().height());
    box_->setValue(state.value);
    box_->setReadOnly(state.fixed);
    box_->setEnabled(!state.fixed);
    QString problem = state.problem;
    if (problem.isEmpty() && !(state.value >= state.low && state.value <= state.high))
        problem = tr("Outside %1 to %2%3").arg(state.low).arg(state.high).arg(state.unit);
    setText(*problem_, problem, Tone::warning);
}

}  // namespace fluorocut::ui

// NumberField: one number that may be edited. What it shows comes as one object: value, limits, unit and what is to be
// said against it, so that a field can never show the value of one thing and the limits of another.
#pragma once

#include <QString>
#include <QWidget>

class QDoubleSpinBox;
class QLabel;

namespace fluorocut::ui {

struct NumberState {
    double value = 0;
    double low = 0, high = 100, step = 0.1;
    int decimals = 1;
    QString unit;        // with its space: " mm"
    QString problem;     // why the value is doubtful or wrong; empty: it is not
    bool fixed = false;  // may be read only

    friend bool operator==(const NumberState&, const NumberState&) = default;
};

class NumberField : public QWidget {
    Q_OBJECT

  public:
    explicit NumberField(const QString& name, QWidget* parent = nullptr);

    void show(const NumberState& state);
    using QWidget::show;
    const NumberState& state() const { return state_; }
    QDoubleSpinBox* box() const { return box_; }

  signals:
    // By hand, finished: an arrow, Enter, or the focus went on.
    void edited(double value);

  private:
    NumberState state_;
    QDoubleSpinBox* box_;
    QLabel* problem_;
};

}  // namespace fluorocut::ui

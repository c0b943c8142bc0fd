// The procedure at a glance: each step with its number, its state as icon and as word, and why it waits or no longer
// holds. It is given a plain list of rows, and tells which one was chosen; what a step means is nobody's business here.
#pragma once

#include <QListWidget>
#include <QString>
#include <vector>

class QPainter;

namespace fluorocut::ui {

enum class StepMark { waiting, ready, running, done, accepted, refused, stale };

// As it stands behind the step's name: "waiting", "stale".
QString wordOf(StepMark mark);

// As it stands before the step's name: a shape of its own, and a colour. Waiting: an empty ring; ready: a ring with an
// arrow; running: half full; done: a full disk; accepted: with a tick; refused: with a cross; stale: a triangle with an
// exclamation mark.
void paintMark(QPainter& painter, const QRectF& box, StepMark mark, const QPalette& palette);

struct NavigatorRow {
    QString name;
    StepMark mark = StepMark::waiting;
    QString detail;  // one line: what there is, or why it is stale or waits

    friend bool operator==(const NavigatorRow&, const NavigatorRow&) = default;
};

class Navigator : public QListWidget {
    Q_OBJECT

  public:
    explicit Navigator(QWidget* parent = nullptr);

    void setRows(const std::vector<NavigatorRow>& rows);
    const std::vector<NavigatorRow>& rows() const { return rows_; }

    // Wide enough for a step's name, whatever the font.
    QSize sizeHint() const override { return {22 * fontMetrics().averageCharWidth() + 60, 400}; }
    QSize minimumSizeHint() const override { return {14 * fontMetrics().averageCharWidth() + 44, 100}; }

  signals:
    void stepChosen(int row);

  private:
    std::vector<NavigatorRow> rows_;
};

}  // namespace fluorocut::ui

// CellEngine: works the pictures of the spreadsheet out, away from the GUI thread.
//
// A cell is a view in a column. Whenever the session's state changes, every cell's inputs are looked at: a cell whose
// inputs are still those of its picture is left alone; any other keeps its old picture, marked stale, until the new
// one is there. Cells that are on the screen come first, and among them the one that has waited longest, so that while
// something is dragged all of them follow in turn.
//
// Work whose inputs are no longer wanted may go on for kGraceMs (while the hand moves, a picture a little late is
// better than none), then it is cancelled: it stops at the next time it asks, within 100 ms for every formula.
#pragma once

#include <QObject>
#include <QString>
#include <compare>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "ui/session/job_runner.h"
#include "ui/session/session.h"
#include "ui/spreadsheet/column.h"

namespace fluorocut::ui {

struct CellKey {
    std::size_t view = 0;
    std::string column;

    friend auto operator<=>(const CellKey&, const CellKey&) = default;
};

struct CellPicture {
    SharedImage image;  // null: none
    QString why;        // there is none: a sentence
    bool stale = false;
    bool failed = false;
    std::optional<double> progress;  // of the work on it
};

class CellEngine : public QObject {
    Q_OBJECT

  public:
    static constexpr int kGraceMs = 100;

    // The formula is `compute` of column.h, but for tests. The session must outlive the engine.
    using Formula =
        std::function<Result<SharedImage>(const Column&, const CaseState&, std::size_t view, ColumnMemory&, Progress&)>;
    explicit CellEngine(Session& session, QObject* parent = nullptr, Formula formula = compute);
    ~CellEngine() override;

    // Hidden ones are not worked out.
    void setColumns(const std::vector<Column>& columns);
    // On the screen: worked out first, and the only ones during a preview.
    void setVisible(std::set<CellKey> visible);

    CellPicture picture(const CellKey& cell) const;
    // Nothing is left to be done.
    bool isIdle() const;

  signals:
    void changed(const fluorocut::ui::CellKey& cell);

  private:
    struct Cell {
        Inputs subject;  // whose picture it is: a new one starts without the old one's picture
        QString missing;
        Inputs wanted, has;
        SharedImage image;
        QString failure;  // of the wanted inputs
        std::uint64_t finished = 0;
        bool running = false;
        std::optional<double> progress;
    };
    struct Worker {
        std::unique_ptr<JobRunner> runner;
        std::optional<CellKey> cell;  // nothing: idle
        Inputs subject, inputs;
        std::uint64_t number = 0;  // of the job
    };

    void update();
    bool updateCell(const CellKey& key, const Column& column);
    void cancelOutdated();
    void start();
    std::optional<CellKey> next() const;
    void finish(std::size_t worker, Result<SharedImage> image);
    static bool isDue(const Cell& cell);
    const Column* columnOf(const std::string& id) const;

    Session& session_;
    Formula formula_;
    Session::State state_;
    std::vector<Column> columns_;
    std::set<CellKey> visible_;
    std::map<CellKey, Cell> cells_;
    std::shared_ptr<ColumnMemory> memory_ = std::make_shared<ColumnMemory>();
    std::uint64_t jobs_ = 0, finished_ = 0;
    std::vector<Worker> workers_;
};

}  // namespace fluorocut::ui

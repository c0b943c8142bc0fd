#include "ui/spreadsheet/cell_engine.h"

#include <QTimer>
#include <algorithm>
#include <utility>

namespace fluorocut::ui {
namespace {

constexpr std::size_t kWorkers = 2;

Inputs subjectOf(const Column& column, const CaseState& state, std::size_t view) {
    const CaseView& row = state.views[view];
    return Inputs()
        .add(row.before.image)
        .add(row.name)
        .add(column.kind)
        .add(column.cut)
        .add(column.against == Against::before ? 0 : 1);
}

}  // namespace

CellEngine::CellEngine(Session& session, QObject* parent, Formula formula)
    : QObject(parent), session_(session), formula_(std::move(formula)), state_(session.state()) {
    for (std::size_t i = 0; i < kWorkers; ++i) {
        workers_.push_back({std::make_unique<JobRunner>(), std::nullopt, {}, {}, 0});
        connect(workers_[i].runner.get(), &JobRunner::progressed, this, [this, i](double fraction, const QString&) {
            if (!workers_[i].cell) return;
            const auto cell = cells_.find(*workers_[i].cell);
            if (cell == cells_.end()) return;
            cell->second.progress = fraction;
            emit changed(cell->first);
        });
        connect(workers_[i].runner.get(), &JobRunner::crashed, this, [this, i](const QString& what) {
            finish(i, noSolution("this picture", "a fault of FluoroCut (" + what.toStdString() + ")", "none",
                                 "please report it"));
        });
    }
    connect(&session_, &Session::changed, this, &CellEngine::update);
}

CellEngine::~CellEngine() {
    for (Worker& worker : workers_)  // all at once, before the first is waited for
        worker.runner->cancel();
}

void CellEngine::setColumns(const std::vector<Column>& columns) {
    columns_.clear();
    std::copy_if(columns.begin(), columns.end(), std::back_inserter(columns_),
                 [](const Column& column) { return !column.hidden; });
    update();
}

void CellEngine::setVisible(std::set<CellKey> visible) {
    visible_ = std::move(visible);
    start();
}

CellPicture CellEngine::picture(const CellKey& key) const {
    const auto found = cells_.find(key);
    if (found == cells_.end()) return {};
    const Cell& cell = found->second;
    CellPicture picture;
    picture.image = cell.image;
    picture.stale = cell.image && !(cell.has == cell.wanted);
    picture.failed = !cell.failure.isEmpty();
    picture.why = cell.missing.isEmpty() ? cell.failure : cell.missing;
    if (isDue(cell)) picture.progress = cell.progress.value_or(0);
    return picture;
}

bool CellEngine::isIdle() const {
    return std::none_of(workers_.begin(), workers_.end(),
                        [](const Worker& worker) { return worker.cell.has_value(); }) &&
           std::none_of(cells_.begin(), cells_.end(), [](const auto& cell) { return isDue(cell.second); });
}

bool CellEngine::isDue(const Cell& cell) {
    return cell.missing.isEmpty() && cell.failure.isEmpty() && !(cell.image && cell.has == cell.wanted);
}

const Column* CellEngine::columnOf(const std::string& id) const {
    const auto found = std::find_if(columns_.begin(), columns_.end(), [&](const Column& c) { return c.id == id; });
    return found == columns_.end() ? nullptr : &*found;
}

void CellEngine::update() {
    state_ = session_.state();
    std::erase_if(cells_, [&](const auto& cell) {
        return cell.first.view >= state_->views.size() || !columnOf(cell.first.column);
    });
    std::vector<CellKey> different;
    for (std::size_t view = 0; view < state_->views.size(); ++view)
        for (const Column& column : columns_)
            if (const CellKey key{view, column.id}; updateCell(key, column)) different.push_back(key);
    cancelOutdated();
    start();
    for (const CellKey& key : different)
        emit changed(key);
}

bool CellEngine::updateCell(const CellKey& key, const Column& column) {
    const bool is_new = !cells_.contains(key);
    Cell& cell = cells_[key];
    Inputs subject = subjectOf(column, *state_, key.view);
    const bool other = is_new || !(subject == cell.subject);
    if (other) {
        const bool running = cell.running;
        cell = {};
        cell.subject = std::move(subject);
        cell.running = running;
    }
    QString lacks = missing(column, *state_, key.view);
    if (!lacks.isEmpty()) {
        const bool changes = other || lacks != cell.missing;
        cell.missing = std::move(lacks);
        cell.image.reset();
        cell.has = cell.wanted = {};
        cell.failure.clear();
        return changes;
    }
    Inputs inputs = inputsOf(column, *state_, key.view);
    if (!other && cell.missing.isEmpty() && inputs == cell.wanted) return false;
    cell.missing.clear();
    cell.failure.clear();
    cell.progress.reset();
    cell.wanted = std::move(inputs);
    if (isAtHand(column)) {
        if (const auto image = formula_(column, *state_, key.view, *memory_, Progress::none())) {
            cell.image = *image;
            cell.has = cell.wanted;
        } else {
            cell.failure = QString::fromStdString(image.error().message());
        }
    }
    return true;
}

void CellEngine::cancelOutdated() {
    for (std::size_t i = 0; i < workers_.size(); ++i) {
        if (!workers_[i].cell) continue;
        const auto cell = cells_.find(*workers_[i].cell);
        if (cell == cells_.end() || !cell->second.missing.isEmpty()) {
            workers_[i].runner->cancel();
        } else if (!(cell->second.wanted == workers_[i].inputs)) {
            QTimer::singleShot(kGraceMs, this, [this, i, number = workers_[i].number] {
                const Worker& worker = workers_[i];
                if (!worker.cell || worker.number != number) return;
                const auto now = cells_.find(*worker.cell);
                if (now == cells_.end() || !(now->second.wanted == worker.inputs)) worker.runner->cancel();
            });
        }
    }
}

std::optional<CellKey> CellEngine::next() const {
    const CellKey* best = nullptr;
    const auto rank = [&](const CellKey& key, const Cell& cell) {
        return std::pair(!visible_.contains(key), cell.finished);
    };
    for (const auto& [key, cell] : cells_) {
        if (cell.running || !isDue(cell)) continue;
        if (session_.isPreviewing() && !visible_.contains(key)) continue;
        if (!best || rank(key, cell) < rank(*best, cells_.at(*best))) best = &key;
    }
    return best ? std::optional(*best) : std::nullopt;
}

void CellEngine::start() {
    for (std::size_t i = 0; i < workers_.size(); ++i) {
        Worker& worker = workers_[i];
        if (worker.cell) continue;
        const std::optional<CellKey> key = next();
        if (!key) return;
        Cell& cell = cells_.at(*key);
        cell.running = true;
        worker.cell = key;
        worker.subject = cell.subject;
        worker.inputs = cell.wanted;
        worker.number = ++jobs_;
        worker.runner->run<SharedImage>(
            [formula = formula_, column = *columnOf(key->column), state = state_, view = key->view,
             memory = memory_](Progress& progress) { return formula(column, *state, view, *memory, progress); },
            [this, i](Result<SharedImage> image) { finish(i, std::move(image)); });
    }
}

void CellEngine::finish(std::size_t index, Result<SharedImage> image) {
    const CellKey key = *std::exchange(workers_[index].cell, std::nullopt);
    const Inputs inputs = std::exchange(workers_[index].inputs, {});
    const Inputs subject = std::exchange(workers_[index].subject, {});
    const auto found = cells_.find(key);
    if (found != cells_.end()) {
        Cell& cell = found->second;
        cell.running = false;
        cell.progress.reset();
        const bool wanted = cell.wanted == inputs;
        if (!(cell.subject == subject)) {
            // Another view stands here by now: not its picture.
        } else if (image && cell.missing.isEmpty() && (wanted || !(cell.has == cell.wanted))) {
            cell.image = *image;
            cell.has = inputs;
            cell.finished = ++finished_;
        } else if (!image && wanted && !image.error().isCancelled()) {
            cell.failure = QString::fromStdString(image.error().message());
            cell.image.reset();
        }
    }
    start();
    if (found != cells_.end()) emit changed(key);
}

}  // namespace fluorocut::ui

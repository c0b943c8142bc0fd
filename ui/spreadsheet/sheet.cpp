#include "ui/spreadsheet/sheet.h"

#include <QGridLayout>
#include <QKeyEvent>
#include <QMenu>
#include <QScrollArea>
#include <QScrollBar>
#include <QSettings>
#include <algorithm>
#include <numeric>

#include "ui/spreadsheet/header_strip.h"
#include "ui/spreadsheet/marks.h"

namespace fluorocut::ui {
namespace {

constexpr int kLeastWidth = 200, kLeastHeight = 180;  // of a cell
constexpr int kGap = 2;
constexpr int kRowHeader = 148, kColumnHeader = 30;

// Lengths that share `available` as their weights say, none below `least`.
std::vector<int> shared(const std::vector<double>& weights, int available, int least) {
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    std::vector<int> lengths;
    for (const double weight : weights)
        lengths.push_back(std::max(least, static_cast<int>(available * weight / sum)));
    return lengths;
}

std::vector<HeaderStrip::Span> spansOf(const std::vector<int>& lengths, int offset) {
    std::vector<HeaderStrip::Span> spans;
    for (const int length : lengths) {
        spans.push_back({offset, offset + length});
        offset += length;
    }
    return spans;
}

}  // namespace

Sheet::Sheet(Session& session, QWidget* parent)
    : QWidget(parent), session_(session), engine_(session), state_(session.state()) {
    auto* layout = new QGridLayout(this);
    layout->setContentsMargins(0, 0, 0, 0);
    layout->setSpacing(0);
    makeToolbar();
    layout->addWidget(toolbar_, 0, 0, 1, 2);
    column_header_ = new HeaderStrip(Qt::Horizontal, true, this);
    column_header_->setFixedHeight(kColumnHeader);
    layout->addWidget(column_header_, 1, 1);
    row_header_ = new HeaderStrip(Qt::Vertical, false, this);
    row_header_->setFixedWidth(kRowHeader);
    layout->addWidget(row_header_, 2, 0);
    area_ = new QScrollArea(this);
    area_->setFrameShape(QFrame::NoFrame);
    area_->setFocusPolicy(Qt::NoFocus);
    body_ = new QWidget;
    area_->setWidget(body_);
    layout->addWidget(area_, 2, 1);
    layout->setRowStretch(2, 1);
    layout->setColumnStretch(1, 1);

    for (QScrollBar* bar : {area_->horizontalScrollBar(), area_->verticalScrollBar()})
        connect(bar, &QScrollBar::valueChanged, this, [this] {
            layOutHeaders();
            updateVisible();
        });
    area_->viewport()->installEventFilter(this);
    area_->installEventFilter(this);  // before it scrolls with the arrow keys that no cell took
    const auto drag = [this](std::vector<double>& weights, Qt::Orientation orientation, int index, int by) {
        const auto& spans = (orientation == Qt::Horizontal ? column_header_ : row_header_)->spans();
        const int least = orientation == Qt::Horizontal ? kLeastWidth : kLeastHeight;
        for (std::size_t i = 0; i < std::min(weights.size(), spans.size()); ++i)
            weights[i] = spans[i].end - spans[i].begin;
        const auto at = static_cast<std::size_t>(index);
        if (at + 1 >= weights.size()) return;
        const double moved = std::clamp<double>(by, least - weights[at], std::max(0.0, weights[at + 1] - least));
        weights[at] += moved;
        weights[at + 1] -= moved;
        layOut();
    };
    connect(column_header_, &HeaderStrip::borderDragged, this,
            [this, drag](int index, int by) { drag(column_weights_, Qt::Horizontal, index, by); });
    connect(row_header_, &HeaderStrip::borderDragged, this,
            [this, drag](int index, int by) { drag(row_weights_, Qt::Vertical, index, by); });
    connect(column_header_, &HeaderStrip::menuRequested, this, [this](int index, const QPoint& at) {
        const auto visible = visibleColumns();
        const std::string id = maximised_ ? maximised_->column : visible.at(static_cast<std::size_t>(index))->id;
        QMenu* menu = makeColumnMenu(id);
        menu->setAttribute(Qt::WA_DeleteOnClose);
        menu->popup(at);
    });
    connect(&engine_, &CellEngine::changed, this, &Sheet::showPicture);
    connect(&silhouettes_, &Silhouettes::prepared, this, &Sheet::refreshOverlays);
    // After the engine, which is connected already: it knows then what is stale.
    connect(&session_, &Session::changed, this, &Sheet::refresh);
    engine_.setColumns(columns_);
    rebuildCells();
}

Sheet::~Sheet() {
    for (auto& [key, cell] : cells_)  // they outlive our tools
        cell->setTool(nullptr);
}

const Column* Sheet::column(const std::string& id) const {
    const auto found = std::find_if(columns_.begin(), columns_.end(), [&](const Column& c) { return c.id == id; });
    return found == columns_.end() ? nullptr : &*found;
}

std::vector<const Column*> Sheet::visibleColumns() const {
    std::vector<const Column*> visible;
    for (const Column& each : columns_)
        if (!each.hidden) visible.push_back(&each);
    return visible;
}

// ---- cells

void Sheet::refresh() {
    const bool other_rows = session_.state()->views.size() != state_->views.size();
    state_ = session_.state();
    if (other_rows) {
        rebuildCells();
        return;
    }
    updateHeaders();
    refreshOverlays();
}

void Sheet::rebuildCells() {
    const auto columns = visibleColumns();
    std::map<CellKey, ImageView*> cells;
    for (std::size_t view = 0; view < state_->views.size(); ++view) {
        for (const Column* each : columns) {
            const CellKey key{view, each->id};
            if (const auto old = cells_.find(key); old != cells_.end()) {
                cells[key] = old->second;
                cells_.erase(old);
            } else {
                auto* cell = new ImageView(body_);
                cell->setMinimumSize(1, 1);
                cells[key] = cell;
                connectCell(key, cell);
            }
        }
    }
    for (auto& [key, cell] : cells_) {
        cell->setTool(nullptr);
        cell->hide();
        cell->deleteLater();  // it may be in the middle of an event
    }
    cells_ = std::move(cells);
    if (maximised_ && !cells_.contains(*maximised_)) maximised_.reset();
    if (current_ && !cells_.contains(*current_)) current_.reset();
    row_weights_.resize(state_->views.size(), row_weights_.empty() ? 1.0 : row_weights_.front());
    if (column_weights_.size() != columns.size()) column_weights_.assign(columns.size(), 1.0);
    std::erase_if(tools_, [&](const auto& tool) { return !cells_.contains(tool.first); });
    for (const auto& [key, cell] : cells_)
        equip(key);
    updateHeaders();
    layOut();
    for (const auto& [key, cell] : cells_)
        showPicture(key);
}

void Sheet::connectCell(const CellKey& key, ImageView* cell) {
    cell->installEventFilter(this);
    connect(cell, &ImageView::displayWindowChanged, this, [this, key] { windowChanged(key); });
    connect(cell, &ImageView::viewChanged, this, [this, key] { glanceChanged(key); });
    connect(cell, &ImageView::maximiseRequested, this, [this, key] { maximised_ ? showAll() : maximise(key); });
    connect(cell, &ImageView::pointedAt, this, [this, key](std::optional<QPointF> pixel) { pointAt(key, pixel); });
}

void Sheet::updateHeaders() {
    std::vector<HeaderText> rows, columns;
    for (std::size_t view = 0; view < state_->views.size(); ++view) {
        if (maximised_ && maximised_->view != view) continue;
        const CaseView& row = state_->views[view];
        HeaderText text;
        text.title = QString::fromStdString(row.name);
        text.lines << anglesText(row.position) << registrationText(row.before);
        text.warning = !row.before.imager_from_femur.has_value();
        text.tip = poseText(row.before);
        rows.push_back(std::move(text));
    }
    for (const Column* each : visibleColumns())
        if (!maximised_ || maximised_->column == each->id) columns.push_back({titleOf(*each), {}, false, {}});
    row_header_->setTexts(std::move(rows));
    column_header_->setTexts(std::move(columns));
}

void Sheet::layOut() {
    const QSize room = area_->viewport()->size();
    const auto columns = visibleColumns();
    if (maximised_) {
        body_->resize(room);
        for (const auto& [key, cell] : cells_) {
            cell->setVisible(key == *maximised_);
            if (key == *maximised_) cell->setGeometry(QRect(QPoint(0, 0), room));
        }
    } else {
        const std::vector<int> widths = shared(column_weights_, room.width(), kLeastWidth);
        const std::vector<int> heights = shared(row_weights_, room.height(), kLeastHeight);
        body_->resize(std::accumulate(widths.begin(), widths.end(), 0),
                      std::accumulate(heights.begin(), heights.end(), 0));
        int top = 0;
        for (std::size_t view = 0; view < heights.size(); ++view) {
            int left = 0;
            for (std::size_t c = 0; c < columns.size(); ++c) {
                ImageView* one = cells_.at({view, columns[c]->id});
                one->setGeometry(left, top, widths[c] - kGap, heights[view] - kGap);
                one->show();
                left += widths[c];
            }
            top += heights[view];
        }
    }
    layOutHeaders();
    updateVisible();
}

void Sheet::layOutHeaders() {
    const QSize room = area_->viewport()->size();
    if (maximised_) {
        column_header_->setSpans({{0, room.width()}});
        row_header_->setSpans({{0, room.height()}});
        return;
    }
    column_header_->setSpans(
        spansOf(shared(column_weights_, room.width(), kLeastWidth), -area_->horizontalScrollBar()->value()));
    row_header_->setSpans(
        spansOf(shared(row_weights_, room.height(), kLeastHeight), -area_->verticalScrollBar()->value()));
}

void Sheet::updateVisible() {
    const QRect window(-body_->pos(), area_->viewport()->size());
    std::set<CellKey> visible;
    for (const auto& [key, cell] : cells_)
        if ((!maximised_ || key == *maximised_) && cell->geometry().intersects(window)) visible.insert(key);
    if (visible != on_screen_) {
        on_screen_ = std::move(visible);
        engine_.setVisible(on_screen_);
    }
    refreshOverlays();
}

// Alone it has to say what it is; in the grid the headers do.
QString Sheet::cellTitle(const CellKey& key) const {
    if (maximised_ != key) return {};
    return QStringLiteral("%1, %2").arg(QString::fromStdString(state_->views[key.view].name),
                                        titleOf(*column(key.column)));
}

void Sheet::showPicture(const CellKey& key) {
    const auto found = cells_.find(key);
    if (found == cells_.end()) return;
    ImageView& cell = *found->second;
    if (!column(key.column) || key.view >= state_->views.size()) return;
    const CellPicture picture = engine_.picture(key);
    if (picture.image != cell.image()) {
        following_ = true;  // none of this is done by hand
        const bool first = !cell.image();
        if (!first && picture.image)
            cell.replaceImage(picture.image);
        else
            cell.setImage(picture.image, cellTitle(key));
        if (first && picture.image) adoptFromLinked(key);
        following_ = false;
    }
    if (picture.image)
        cell.setMessage({});
    else if (!picture.why.isEmpty())
        cell.setMessage(picture.why);
    else
        cell.setMessage(tr("Working it out"), picture.progress);
    showMarks(key);
}

void Sheet::showMarks(const CellKey& key) {
    ImageView& cell = *cells_.at(key);
    const Column& of = *column(key.column);
    ViewMarks marks = marksOf(*state_, key.view, fluorocut::ui::pictureOf(of, *state_, key.view));
    if (maximised_ != key) marks.header.clear();  // it stands at the head of the row
    cell.setTitle(cellTitle(key));
    if (const QString note = noteOf(of, *state_, key.view); !note.isEmpty()) marks.header << note;
    if (engine_.picture(key).stale) marks.stale = tr("being worked out anew");
    cell.setMarks(marks);
}

void Sheet::refreshOverlays() {
    // Columns of one view mostly show the same place: each silhouette is projected once.
    struct Drawn {
        std::size_t view;
        int cut;
        bool straight;
        auto operator<=>(const Drawn&) const = default;
    };
    std::map<std::pair<Drawn, OverlayKind>, Overlay> drawn;
    for (const CellKey& key : on_screen_) {
        const Column& of = *column(key.column);
        const Picture picture = fluorocut::ui::pictureOf(of, *state_, key.view);
        const Drawn place{key.view, picture.cut, !picture.carm.distortion};
        Overlay all;
        for (const OverlayKind kind : of.overlays) {
            if (!shown_.contains(kind)) continue;
            auto [at, is_new] = drawn.try_emplace({place, kind});
            if (is_new) at->second = overlayOf(kind, *state_, picture, silhouettes_);
            all.curves.insert(all.curves.end(), at->second.curves.begin(), at->second.curves.end());
            all.marks.insert(all.marks.end(), at->second.marks.begin(), at->second.marks.end());
        }
        if (extra_) {
            Overlay extra = extra_(key.view, picture);
            all.curves.insert(all.curves.end(), extra.curves.begin(), extra.curves.end());
            all.marks.insert(all.marks.end(), extra.marks.begin(), extra.marks.end());
        }
        cells_.at(key)->setOverlay(std::move(all));
        showMarks(key);
    }
}

ImageView* Sheet::cell(std::size_t view, const std::string& column) const {
    const auto found = cells_.find({view, column});
    return found == cells_.end() ? nullptr : found->second;
}

std::vector<ImageView*> Sheet::cells() const {
    std::vector<ImageView*> all;
    for (const auto& [key, cell] : cells_)
        all.push_back(cell);
    return all;
}

std::optional<CellKey> Sheet::keyOf(const ImageView& cell) const {
    for (const auto& [key, each] : cells_)
        if (each == &cell) return key;
    return std::nullopt;
}

std::optional<std::size_t> Sheet::viewOf(const ImageView& cell) const {
    const auto key = keyOf(cell);
    return key ? std::optional(key->view) : std::nullopt;
}

std::optional<Picture> Sheet::pictureOf(const ImageView& cell) const {
    const auto key = keyOf(cell);
    if (!key || key->view >= state_->views.size()) return std::nullopt;
    return fluorocut::ui::pictureOf(*column(key->column), *state_, key->view);
}

// ---- tools

void Sheet::setTools(ToolFactory factory) {
    for (auto& [key, cell] : cells_)
        cell->setTool(nullptr);
    tools_.clear();
    tool_factory_ = std::move(factory);
    for (const auto& [key, cell] : cells_)
        equip(key);
}

void Sheet::equip(const CellKey& key) {
    if (!tool_factory_ || tools_.contains(key)) return;
    const Picture picture = fluorocut::ui::pictureOf(*column(key.column), *state_, key.view);
    if (picture.cut > 0 || picture.carm.distortion != state_->views[key.view].carm.distortion) return;
    std::unique_ptr<ViewTool>& tool = tools_[key];
    tool = tool_factory_(key.view);
    cells_.at(key)->setTool(tool.get());
}

void Sheet::setExtraOverlay(ExtraOverlay extra) {
    extra_ = std::move(extra);
    refreshOverlays();
}

// ---- one cell, and from one to another

void Sheet::maximise(const CellKey& key) {
    if (!cells_.contains(key)) return;
    maximised_ = key;
    updateHeaders();
    layOut();
    setCurrent(key);
}

void Sheet::showAll() {
    if (!maximised_) return;
    maximised_.reset();
    updateHeaders();
    layOut();
    if (current_) setCurrent(*current_);
}

void Sheet::setCurrent(const CellKey& key) {
    const auto found = cells_.find(key);
    if (found == cells_.end()) return;
    if (maximised_ && *maximised_ != key) {
        maximised_ = key;
        updateHeaders();
        layOut();
    }
    found->second->setFocus(Qt::OtherFocusReason);
    area_->ensureWidgetVisible(found->second, 0, 0);
    if (current_ == key) return;
    current_ = key;
    emit currentChanged(key.view, QString::fromStdString(key.column));
}

bool Sheet::travel(int pressed) {
    const auto columns = visibleColumns();
    if (!current_ || columns.empty()) return false;
    const auto at =
        std::find_if(columns.begin(), columns.end(), [&](const Column* c) { return c->id == current_->column; });
    if (at == columns.end()) return false;
    auto column = static_cast<int>(at - columns.begin());
    auto view = static_cast<int>(current_->view);
    column += (pressed == Qt::Key_Right) - (pressed == Qt::Key_Left);
    view += (pressed == Qt::Key_Down) - (pressed == Qt::Key_Up);
    if (column < 0 || column >= static_cast<int>(columns.size()) || view < 0 ||
        view >= static_cast<int>(state_->views.size()))
        return true;  // at the border: nowhere to go
    setCurrent({static_cast<std::size_t>(view), columns[static_cast<std::size_t>(column)]->id});
    return true;
}

bool Sheet::eventFilter(QObject* object, QEvent* event) {
    if (object == area_->viewport()) {
        if (event->type() == QEvent::Resize) layOut();
        return false;
    }
    if (object == area_) {
        if (event->type() != QEvent::KeyPress) return false;
        const auto* key = static_cast<QKeyEvent*>(event);
        const bool arrow = key->key() >= Qt::Key_Left && key->key() <= Qt::Key_Down;
        const bool always = key->modifiers() & (Qt::AltModifier | Qt::ControlModifier);
        return arrow && (always || !arrows_are_tools_) && travel(key->key());
    }
    const auto* cell = qobject_cast<ImageView*>(object);
    if (!cell) return false;
    switch (event->type()) {
        case QEvent::FocusIn:
            if (const auto key = keyOf(*cell); key && current_ != key) {
                current_ = key;
                emit currentChanged(key->view, QString::fromStdString(key->column));
            }
            return false;
        case QEvent::Leave:
            leaving_ = true;  // pointing from here on in another view makes a point in space
            return false;
        case QEvent::KeyRelease:
            if (static_cast<QKeyEvent*>(event)->key() == Qt::Key_Shift) {
                pointing_.clear();
                showPointing();
            }
            return false;
        default:
            return false;
    }
}

void Sheet::keyPressEvent(QKeyEvent* event) {
    if ((event->key() == Qt::Key_Return || event->key() == Qt::Key_Enter) && current_)
        maximised_ ? showAll() : maximise(*current_);
    else if (event->key() == Qt::Key_Escape && maximised_)
        showAll();
    else
        QWidget::keyPressEvent(event);
}

void Sheet::resizeEvent(QResizeEvent* event) {
    QWidget::resizeEvent(event);
    fitToolbar();
    layOut();
}

// ---- links

bool Sheet::linked(const CellKey& a, const CellKey& b) const {
    if (a == b || link_ == Link::none) return false;
    return link_ == Link::row ? a.view == b.view : a.column == b.column;
}

void Sheet::windowChanged(const CellKey& from) {
    if (following_ || !cells_.contains(from)) return;
    following_ = true;
    const DisplayWindow window = cells_.at(from)->displayWindow();
    for (const auto& [key, cell] : cells_)
        if (linked(from, key) && cell->image() && showsLevels(*column(key.column)) == showsLevels(*column(from.column)))
            cell->setDisplayWindow(window);
    following_ = false;
}

void Sheet::glanceChanged(const CellKey& from) {
    if (following_ || !cells_.contains(from)) return;
    following_ = true;
    const ImageView::Glance glance = cells_.at(from)->glance();
    for (const auto& [key, cell] : cells_)
        if (linked(from, key)) cell->setGlance(glance);
    following_ = false;
}

void Sheet::adoptFromLinked(const CellKey& key) {
    ImageView& cell = *cells_.at(key);
    for (const auto& [other, source] : cells_) {
        if (!linked(key, other) || !source->image()) continue;
        if (source->image()->width() == cell.image()->width() && !source->isFitted()) cell.setGlance(source->glance());
        if (showsLevels(*column(key.column)) != showsLevels(*column(other.column))) continue;
        cell.setDisplayWindow(source->displayWindow());
        return;
    }
}

void Sheet::setLink(Link link) {
    link_ = link;
    updateToolbar();
}

void Sheet::fitAll() {
    following_ = true;
    for (const auto& [key, cell] : cells_)
        cell->fit();
    following_ = false;
}

void Sheet::resetWindows() {
    following_ = true;
    for (const auto& [key, cell] : cells_)
        cell->resetDisplayWindow();
    following_ = false;
}

void Sheet::setShown(OverlayKind kind, bool shown) {
    shown ? (void)shown_.insert(kind) : (void)shown_.erase(kind);
    updateToolbar();
    refreshOverlays();
}

// ---- pointing

void Sheet::pointAt(const CellKey& from, std::optional<QPointF> pixel) {
    const bool left = std::exchange(leaving_, false);
    if (pixel && column(from.column) && from.view < state_->views.size()) {
        pointing_.pointAt(
            {from.view, fluorocut::ui::pictureOf(*column(from.column), *state_, from.view), {pixel->x(), pixel->y()}});
    } else if (!left) {
        pointing_.clear();  // Shift is no longer held
    }
    showPointing();
}

void Sheet::showPointing() {
    for (const auto& [key, cell] : cells_)
        cell->setPassingOverlay(
            pointing_.empty()
                ? Overlay{}
                : pointing_.overlayFor(key.view, fluorocut::ui::pictureOf(*column(key.column), *state_, key.view)));
    emit pointedAt(pointing_.point() ? std::optional(pointing_.point()->point) : std::nullopt);
}

}  // namespace fluorocut::ui

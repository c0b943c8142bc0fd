#include "ui/panels/measure_tool.h"

#include <algorithm>

#include "ui/panels/measurements.h"
#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {

MeasureTool::MeasureTool(Session& session, MeasureChoice& choice, std::size_t view, QObject* parent)
    : QObject(parent), session_(session), choice_(choice), view_(view) {
    connect(&choice_, &MeasureChoice::changed, this, [this] { pending_.clear(); });
}

std::size_t MeasureTool::pointsNeeded() const {
    return choice_.mode() == MeasureMode::length ? 2 : choice_.mode() == MeasureMode::angle ? 4 : 0;
}

std::optional<MeasureTool::Point> MeasureTool::pointAt(const CaseState& state, const Touch& touch) const {
    std::optional<Point> nearest;
    double reach = touch.reach_px;
    const auto consider = [&](const Point& point, const Vector2& at) {
        if (const double distance = (at - touch.at_px).norm(); distance <= reach) {
            reach = distance;
            nearest = point;
        }
    };
    for (std::size_t m = 0; m < state.measures.size(); ++m) {
        if (state.measures[m].view != view_) continue;
        for (std::size_t p = 0; p < state.measures[m].points_px.size(); ++p)
            consider({m, p}, state.measures[m].points_px[p]);
    }
    for (const SeenPoint& seen : state.head_center)
        if (seen.view == view_) consider({kHead, 0}, seen.at_px);
    return nearest;
}

bool MeasureTool::wants(const Touch& touch) const {
    return choice_.mode() != MeasureMode::none || held_ || pointAt(*session_.state(), touch);
}

bool MeasureTool::press(ImageView&, const Touch& touch) {
    start_ = session_.committed();
    pulling_ = false;
    if (pending_.empty()) {
        held_ = chosen_ = pointAt(*start_, touch);
        if (held_) {
            if (held_->measure == kHead) {
                for (const SeenPoint& seen : start_->head_center)
                    if (seen.view == view_) offset_ = seen.at_px - touch.at_px;
            } else {
                offset_ = start_->measures[held_->measure].points_px[held_->point] - touch.at_px;
            }
            return true;
        }
    }
    if (choice_.mode() == MeasureMode::none || view_ >= start_->views.size()) return false;
    if (choice_.mode() == MeasureMode::head_center) {
        setHeadCenter(touch.at_px);
        return true;
    }
    pending_.push_back(touch.at_px);
    pulling_ = pending_.size() % 2 == 0;  // the second click of a line
    return true;
}

void MeasureTool::drag(ImageView&, const Touch& touch) {
    if (held_) {
        if (session_.committed() != start_) {
            held_.reset();
            session_.dropPreview();
            return;
        }
        CaseState next = *start_;
        const Vector2 at = touch.at_px + offset_;
        if (held_->measure == kHead) {
            for (SeenPoint& seen : next.head_center)
                if (seen.view == view_) seen.at_px = at;
        } else {
            next.measures[held_->measure].points_px[held_->point] = at;
        }
        session_.preview(std::move(next));
        return;
    }
    if (pending_.empty()) return;
    if (pulling_)
        pending_.back() = touch.at_px;
    else if ((touch.at_px - pending_.back()).norm() > touch.reach_px) {
        pending_.push_back(touch.at_px);
        pulling_ = true;
    }
}

void MeasureTool::release(ImageView&, const Touch&) {
    pulling_ = false;
    if (held_) {
        held_.reset();
        if (session_.isPreviewing()) session_.commit(tr("Move point of a measure"), *session_.state());
        return;
    }
    if (!pending_.empty() && pending_.size() == pointsNeeded()) finish();
}

void MeasureTool::finish() {
    CaseState next = *session_.committed();
    const bool length = choice_.mode() == MeasureMode::length;
    next.measures.push_back({length ? MeasureKind::length : MeasureKind::angle, view_, std::move(pending_)});
    pending_.clear();
    chosen_ = Point{next.measures.size() - 1, 1};
    session_.commit(length ? tr("Measure length") : tr("Measure angle"), std::move(next));
}

void MeasureTool::setHeadCenter(const Vector2& at_px) {
    CaseState next = *session_.committed();
    std::erase_if(next.head_center, [&](const SeenPoint& seen) { return seen.view == view_; });
    next.head_center.push_back({view_, at_px});
    chosen_ = Point{kHead, 0};
    session_.commit(tr("Set head centre"), std::move(next));
}

Qt::CursorShape MeasureTool::hover(ImageView&, const Touch& touch) {
    return pointAt(*session_.state(), touch) ? Qt::PointingHandCursor : Qt::CrossCursor;
}

bool MeasureTool::key(ImageView&, int key, Qt::KeyboardModifiers) {
    if (key == Qt::Key_Escape) {
        if (held_) {
            held_.reset();
            session_.dropPreview();
        } else if (!pending_.empty()) {
            pending_.clear();
        } else {
            return false;
        }
        return true;
    }
    if ((key != Qt::Key_Delete && key != Qt::Key_Backspace) || !chosen_ || held_) return false;
    CaseState next = *session_.committed();
    if (chosen_->measure == kHead) {
        if (std::erase_if(next.head_center, [&](const SeenPoint& seen) { return seen.view == view_; }) == 0)
            return false;
        chosen_.reset();
        session_.commit(tr("Delete head centre"), std::move(next));
        return true;
    }
    // Undo may have taken it away meanwhile.
    if (chosen_->measure >= next.measures.size() || next.measures[chosen_->measure].view != view_) return false;
    next.measures.erase(next.measures.begin() + static_cast<std::ptrdiff_t>(chosen_->measure));
    chosen_.reset();
    session_.commit(tr("Delete measure"), std::move(next));
    return true;
}

Overlay MeasureTool::overlay(const ImageView&) const {
    Overlay drawn;
    const CaseState& state = *session_.state();
    const auto draw = [&](const std::vector<Vector2>& points, std::optional<std::size_t> measure) {
        for (std::size_t p = 0; p < points.size(); ++p) {
            const bool chosen = measure && chosen_ == Point{*measure, p};
            drawn.marks.push_back({Ink::measure, points[p], chosen ? MarkShape::ring : MarkShape::dot, {}});
            if (p % 2 == 1) drawn.curves.push_back({Ink::measure, {points[p - 1], points[p]}, false, false});
        }
        // Two lines that belong together.
        if (points.size() == 4)
            drawn.curves.push_back(
                {Ink::measure, {0.5 * (points[0] + points[1]), 0.5 * (points[2] + points[3])}, false, true});
    };
    for (std::size_t m = 0; m < state.measures.size(); ++m) {
        const PlacedMeasure& placed = state.measures[m];
        if (placed.view != view_ || placed.points_px.empty()) continue;
        draw(placed.points_px, m);
        drawn.marks.back().name = textOf(measureOf(state, placed));
    }
    draw(pending_, {});
    for (const SeenPoint& seen : state.head_center)
        if (seen.view == view_) drawn.marks.push_back({Ink::measure, seen.at_px, MarkShape::cross, tr("Head")});
    return drawn;
}

}  // namespace fluorocut::ui

#include "ui/wizards/check_list.h"

#include <QGridLayout>
#include <QLabel>
#include <QPainter>
#include <cmath>

#include "ui/panels/navigator.h"

namespace fluorocut::ui {
namespace {

StepMark markOf(Light light) {
    switch (light) {
        case Light::working:
            return StepMark::running;
        case Light::met:
            return StepMark::accepted;
        case Light::doubtful:
            return StepMark::stale;
        case Light::failed:
            return StepMark::refused;
        case Light::unknown:
            break;
    }
    return StepMark::waiting;
}

QString number(double value, const std::string& unit) {
    const QString text = QString::number(value, 'g', 3);
    return unit.empty() ? text : text + " " + QString::fromStdString(unit);
}

}  // namespace

QString wordOf(Light light) {
    switch (light) {
        case Light::working:
            return CheckList::tr("measuring");
        case Light::met:
            return CheckList::tr("met");
        case Light::doubtful:
            return CheckList::tr("look at it");
        case Light::failed:
            return CheckList::tr("not met");
        case Light::unknown:
            break;
    }
    return CheckList::tr("not measured");
}

CheckRow rowOf(const Judgement& judgement) {
    CheckRow row;
    row.what = QString::fromStdString(judgement.what);
    const bool measured = !std::isnan(judgement.value);
    if (measured) row.value = number(judgement.value, judgement.unit);
    const bool has_least = std::isfinite(judgement.least), has_most = std::isfinite(judgement.most);
    if (has_least && has_most)
        row.limit = CheckList::tr("%1 to %2").arg(number(judgement.least, ""), number(judgement.most, judgement.unit));
    else if (has_least)
        row.limit = CheckList::tr("at least %1").arg(number(judgement.least, judgement.unit));
    else if (has_most)
        row.limit = CheckList::tr("at most %1").arg(number(judgement.most, judgement.unit));
    row.light = judgement.accepted() ? Light::met : measured ? Light::failed : Light::unknown;
    if (!judgement.accepted()) row.reason = QString::fromStdString(judgement.sentence());
    return row;
}

LightIcon::LightIcon(QWidget* parent) : QWidget(parent) {
    setSizePolicy(QSizePolicy::Fixed, QSizePolicy::Fixed);
}

QSize LightIcon::sizeHint() const {
    const int side = fontMetrics().height() * 5 / 4;
    return {side, side};
}

void LightIcon::setLight(Light light) {
    light_ = light;
    setAccessibleName(wordOf(light));
    update();
}

void LightIcon::paintEvent(QPaintEvent*) {
    QPainter painter(this);
    const double side = std::min(width(), height());
    paintMark(painter, QRectF(0, 0, side, side), markOf(light_), palette());
}

CheckList::CheckList(QWidget* parent) : QWidget(parent), grid_(new QGridLayout(this)) {
    grid_->setContentsMargins(0, 0, 0, 0);
    grid_->setHorizontalSpacing(fontMetrics().averageCharWidth());
    grid_->setVerticalSpacing(2);
    grid_->setColumnStretch(1, 1);
}

void CheckList::setRows(const std::vector<CheckRow>& rows) {
    if (rows == rows_) return;
    rows_ = rows;
    while (QLayoutItem* item = grid_->takeAt(0)) {
        if (item->widget()) item->widget()->deleteLater();
        delete item;
    }
    const auto label = [this](const QString& text, bool bold, QPalette::ColorRole role) {
        auto* made = new QLabel(text, this);
        made->setTextFormat(Qt::PlainText);
        made->setWordWrap(true);
        made->setForegroundRole(role);
        QFont font = made->font();
        font.setBold(bold);
        made->setFont(font);
        return made;
    };
    int line = 0;
    for (const CheckRow& row : rows) {
        auto* icon = new LightIcon(this);
        icon->setLight(row.light);
        grid_->addWidget(icon, line, 0, Qt::AlignTop);
        grid_->addWidget(label(row.what, false, QPalette::WindowText), line, 1);
        auto* value = label(row.value, true, QPalette::WindowText);
        value->setWordWrap(false);
        grid_->addWidget(value, line, 2, Qt::AlignRight | Qt::AlignTop);
        ++line;
        const QString word = wordOf(row.light);
        const QString second = row.limit.isEmpty() ? word : tr("%1; %2").arg(word, row.limit);
        grid_->addWidget(label(second, false, QPalette::PlaceholderText), line++, 1, 1, 2);
        if (!row.reason.isEmpty()) grid_->addWidget(label(row.reason, false, QPalette::WindowText), line++, 1, 1, 2);
        grid_->setRowMinimumHeight(line++, fontMetrics().height() / 4);
    }
}

}  // namespace fluorocut::ui

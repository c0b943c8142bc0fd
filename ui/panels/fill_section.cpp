#include <QLabel>
#include <QVBoxLayout>
#include <cmath>

#include "core/planning/measures.h"
#include "ui/panels/plan_sections.h"

namespace fluorocut::ui {
namespace {

constexpr double kLeastWallMm = 2;  // as templating's usual limit

QString percent(double part) {
    return QStringLiteral("%1 %").arg(100 * part, 0, 'f', 0);
}

}  // namespace

FillSection::FillSection(PlanStudy& study, QWidget* parent) : Section(tr("Fill and wall"), parent), study_(study) {
    table_ = new QLabel(this);
    table_->setTextFormat(Qt::RichText);
    table_->setObjectName("fill");
    wall_ = new QLabel(this);
    wall_->setWordWrap(true);
    wall_->setObjectName("wall");
    body()->addWidget(table_);
    body()->addWidget(wall_);
    refresh();
}

void FillSection::refresh() {
    const bool stale = study_.fitIsStale();
    setState(study_.message(), stale || study_.isFailure() ? Tone::warning : Tone::quiet);
    const StemInBone* fit = study_.fit();
    table_->setVisible(fit != nullptr);
    table_->setEnabled(!stale);
    if (!fit) {
        setText(*wall_, {}, Tone::plain);
        return;
    }
    const auto cell = [](const QString& text, const char* align, const char* tag) {
        return QStringLiteral("<%1 align='%2' style='padding-right:14px'>%3</%1>").arg(tag, align, text);
    };
    QString rows = "<tr>" + cell(tr("Below"), "left", "th") + cell(tr("Mediolat."), "right", "th") +
                   cell(tr("Anteropost."), "right", "th") + cell(tr("Area"), "right", "th") + "</tr>";
    for (const FillLevel& level : fit->fill)
        rows += "<tr>" + cell(tr("%1 mm").arg(level.below_mm, 0, 'f', 0), "left", "td") +
                cell(percent(level.medioLateral()), "right", "td") +
                cell(percent(level.anteroPosterior()), "right", "td") + cell(percent(level.area), "right", "td") +
                "</tr>";
    table_->setText("<table cellspacing='2'>" + rows + "</table>");
    const LeastWall& wall = fit->least_wall;
    if (!std::isfinite(wall.thickness_mm)) {
        setText(*wall_, tr("No wall beside the stem was found."), Tone::warning);
        return;
    }
    const QString side = QString::fromStdString(wall.side);
    QString text = tr("Least wall %1 mm, %2, %3 mm below the resection%4")
                       .arg(wall.thickness_mm, 0, 'f', 1)
                       .arg(side)
                       .arg(wall.below_mm, 0, 'f', 0)
                       .arg(wall.cut ? tr(", cut by the stem") : QString());
    Measure measure;
    measure.value = wall.thickness_mm;
    measure.sigma = 0.07;  // how well walls are found (core/planning/bone_walls.h)
    const auto danger = perforationWarning(measure, wall.side, kLeastWallMm);
    if (danger) text += "\n" + QString::fromStdString(*danger);
    setText(*wall_, text, danger ? Tone::warning : Tone::plain);
}

}  // namespace fluorocut::ui

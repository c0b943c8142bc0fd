#include <QButtonGroup>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QToolButton>
#include <QVBoxLayout>
#include <cmath>

#include "ui/panels/measurements.h"
#include "ui/panels/plan_sections.h"

namespace fluorocut::ui {

struct MeasuresSection::Row {
    QLabel *name, *value, *note;
    QToolButton* remove;
    std::optional<std::size_t> placed;

    ~Row() {
        for (QWidget* widget : {static_cast<QWidget*>(name), static_cast<QWidget*>(value), static_cast<QWidget*>(note),
                                static_cast<QWidget*>(remove)})
            widget->deleteLater();
    }
};

MeasuresSection::MeasuresSection(Session& session, PlanStudy& study, MeasureChoice& choice, QWidget* parent)
    : Section(tr("Measures"), parent), session_(session), study_(study), choice_(choice) {
    auto* bar = new QHBoxLayout;
    tools_ = new QButtonGroup(this);
    tools_->setExclusive(false);  // a second click lets go of the tool
    for (const auto& [mode, name, hint] :
         {std::tuple(MeasureMode::length, tr("Length"), tr("Drag a line in a view")),
          std::tuple(MeasureMode::angle, tr("Angle"), tr("Drag two lines in a view")),
          std::tuple(MeasureMode::head_center, tr("Head centre"), tr("Click the head's centre in two views"))}) {
        auto* button = new QToolButton(this);
        button->setText(name);
        button->setToolTip(hint);
        button->setCheckable(true);
        button->setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
        button->setObjectName(QStringLiteral("measure%1").arg(static_cast<int>(mode)));
        tools_->addButton(button, static_cast<int>(mode));
        bar->addWidget(button);
        connect(button, &QToolButton::clicked, this,
                [this, m = mode](bool checked) { choice_.setMode(checked ? m : MeasureMode::none); });
    }
    body()->addLayout(bar);
    rows_ = new QGridLayout;
    rows_->setColumnStretch(0, 1);
    body()->addLayout(rows_);
    connect(&choice_, &MeasureChoice::changed, this, &MeasuresSection::refresh);
    refresh();
}

MeasuresSection::~MeasuresSection() = default;

void MeasuresSection::refresh() {
    const MeasureMode mode = choice_.mode();
    for (QAbstractButton* button : tools_->buttons())
        button->setChecked(tools_->id(button) == static_cast<int>(mode));
    setState(mode == MeasureMode::length        ? tr("Drag from one end to the other in a view. Escape forgets it.")
             : mode == MeasureMode::angle       ? tr("Drag two lines in one view. Escape forgets them.")
             : mode == MeasureMode::head_center ? tr("Click the centre of the femur's own head in two views.")
                                                : QString());
    const auto femur = study_.femur();
    const auto measures = measuresOf(*session_.state(), femur ? std::optional<LineFit>(femur->canal) : std::nullopt);
    while (shown_.size() > measures.size())
        shown_.pop_back();
    while (shown_.size() < measures.size()) {
        auto row = std::make_unique<Row>();
        row->name = new QLabel(this);
        row->value = new QLabel(this);
        row->value->setAlignment(Qt::AlignRight | Qt::AlignVCenter);
        row->note = new QLabel(this);
        row->note->setWordWrap(true);
        row->remove = new QToolButton(this);
        row->remove->setText(QStringLiteral("\u00d7"));
        row->remove->setToolTip(tr("Delete this measure"));
        row->remove->setObjectName(QStringLiteral("remove%1").arg(shown_.size()));
        connect(row->remove, &QToolButton::clicked, this, [this, of = row.get()] {
            if (of->placed) remove(*of->placed);
        });
        const int at = 2 * static_cast<int>(shown_.size());
        rows_->addWidget(row->name, at, 0);
        rows_->addWidget(row->value, at, 1);
        rows_->addWidget(row->remove, at, 2);
        rows_->addWidget(row->note, at + 1, 0, 1, 3);
        shown_.push_back(std::move(row));
    }
    for (std::size_t i = 0; i < measures.size(); ++i) {
        const NamedMeasure& measure = measures[i];
        Row& row = *shown_[i];
        row.placed = measure.placed;
        row.name->setText(measure.name);
        row.value->setText(textOf(measure.measure));
        row.remove->setVisible(measure.placed.has_value());
        const bool known = std::isfinite(measure.measure.value);
        QString note = known ? QString::fromStdString(measure.measure.plane) : QString();
        for (const std::string& warning : measure.measure.warnings)
            note += (note.isEmpty() ? "" : "; ") + QString::fromStdString(warning);
        setText(*row.note, note, known && !measure.measure.warnings.empty() ? Tone::warning : Tone::quiet);
    }
}

void MeasuresSection::remove(std::size_t placed) {
    CaseState next = *session_.committed();
    if (placed >= next.measures.size()) return;
    next.measures.erase(next.measures.begin() + static_cast<std::ptrdiff_t>(placed));
    session_.commit(tr("Delete measure"), std::move(next));
}

}  // namespace fluorocut::ui

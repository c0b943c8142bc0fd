#include "ui/panels/plan_inspector.h"

#include <QEvent>
#include <QHBoxLayout>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QScrollArea>
#include <QScrollBar>
#include <QVBoxLayout>

namespace fluorocut::ui {

PlanInspector::PlanInspector(Session& session, MeasureChoice& measuring, QWidget* parent)
    : QWidget(parent), study_(session), jobs_(session, study_) {
    auto* all = new QVBoxLayout(this);
    all->setContentsMargins(0, 0, 0, 0);
    all->setSpacing(0);
    area_ = new QScrollArea(this);
    area_->setWidgetResizable(true);
    area_->setFrameShape(QFrame::NoFrame);
    area_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    auto* content = new QWidget(area_);
    auto* column = new QVBoxLayout(content);
    const int margin = fontMetrics().height() / 2;
    column->setContentsMargins(margin, margin, margin, margin);
    column->setSpacing(margin);
    implant_ = new ImplantSection(session, jobs_, content);
    pose_ = new PoseSection(session, study_, content);
    measures_ = new MeasuresSection(session, study_, measuring, content);
    fill_ = new FillSection(study_, content);
    stages_ = new StagesSection(session, jobs_, content);
    for (QWidget* section :
         {static_cast<QWidget*>(implant_), static_cast<QWidget*>(pose_), static_cast<QWidget*>(measures_),
          static_cast<QWidget*>(fill_), static_cast<QWidget*>(stages_)})
        column->addWidget(section);
    column->addStretch(1);
    area_->setWidget(content);
    all->addWidget(area_, 1);

    // What runs, and what it had to say: always in sight, below.
    job_ = new QWidget(this);
    auto* job = new QVBoxLayout(job_);
    job->setContentsMargins(margin, margin / 2, margin, margin / 2);
    job_name_ = new QLabel(job_);
    job_name_->setWordWrap(true);
    job_bar_ = new QProgressBar(job_);
    job_bar_->setRange(0, 1000);
    job_bar_->setTextVisible(false);
    auto* cancel = new QPushButton(tr("Cancel"), job_);
    cancel->setObjectName("cancel");
    auto* row = new QHBoxLayout;
    row->addWidget(job_bar_, 1);
    row->addWidget(cancel);
    job->addWidget(job_name_);
    job->addLayout(row);
    all->addWidget(job_);
    notes_ = new QLabel(this);
    notes_->setObjectName("notes");
    notes_->setWordWrap(true);
    notes_->setContentsMargins(margin, margin / 2, margin, margin / 2);
    notes_->hide();
    all->addWidget(notes_);

    connect(&session, &Session::changed, this, &PlanInspector::refresh);
    connect(&study_, &PlanStudy::changed, this, &PlanInspector::refresh);
    connect(&jobs_, &PlanJobs::changed, this, [this] {
        showJob();
        refresh();
    });
    connect(&jobs_, &PlanJobs::progressed, this, [this](double fraction, const QString& label) {
        job_bar_->setValue(static_cast<int>(1000 * fraction));
        job_bar_->setToolTip(label);
    });
    connect(&jobs_, &PlanJobs::finished, this,
            [this](bool ok, const QString& notes) { setText(*notes_, notes, ok ? Tone::quiet : Tone::warning); });
    connect(cancel, &QPushButton::clicked, &jobs_, &PlanJobs::cancel);
    connect(implant_, &ImplantSection::keptPointChanged, this, &PlanInspector::keptPointChanged);
    showJob();
    fitWidth();
}

void PlanInspector::refresh() {
    if (!isVisible()) return;
    implant_->refresh();
    pose_->refresh();
    measures_->refresh();
    fill_->refresh();
    stages_->refresh();
    fitWidth();
}

void PlanInspector::showEvent(QShowEvent* event) {
    QWidget::showEvent(event);
    refresh();
}

void PlanInspector::showJob() {
    job_->setVisible(jobs_.running() != PlanJobs::Job::none);
    if (jobs_.running() == PlanJobs::Job::none) return;
    setText(*notes_, {}, Tone::plain);
    job_bar_->setValue(0);
    job_name_->setText(jobs_.running() == PlanJobs::Job::automatic ? tr("Planning automatically")
                                                                   : tr("Working out cavities"));
}

// As wide as the content needs: nothing is ever cut off at the side.
void PlanInspector::fitWidth() {
    const int width = area_->widget()->minimumSizeHint().width() + area_->verticalScrollBar()->sizeHint().width();
    if (width != area_->minimumWidth()) area_->setMinimumWidth(width);
}

bool PlanInspector::event(QEvent* event) {
    const bool done = QWidget::event(event);
    if (event->type() == QEvent::LayoutRequest || event->type() == QEvent::FontChange) fitWidth();
    return done;
}

}  // namespace fluorocut::ui

#include "ui/wizards/wizard_page.h"

#include <QHBoxLayout>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QScrollArea>
#include <QVBoxLayout>
#include <QVariant>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "ui/panels/section.h"

namespace fluorocut::ui {
namespace {

QLabel* wrapped(QWidget* parent) {
    auto* label = new QLabel(parent);
    label->setWordWrap(true);
    label->setTextFormat(Qt::PlainText);
    return label;
}

}  // namespace

WizardPage::WizardPage(const QString& id, const QString& title, const QString& instruction, QWidget* parent)
    : QWidget(parent),
      id_(id),
      title_(title),
      instruction_(wrapped(this)),
      picture_(new QWidget(this)),
      view_(new ImageView(picture_)) {
    QFont large = font();
    large.setPointSizeF(1.2 * large.pointSizeF());
    instruction_->setFont(large);
    instruction_->setText(instruction);
    picture_box_ = new QVBoxLayout(picture_);
    picture_box_->setContentsMargins(0, 0, 0, 0);
    picture_box_->addWidget(view_);

    auto* side = new QWidget;
    auto* rows = new QVBoxLayout(side);
    const int gap = fontMetrics().height() / 2;
    rows->setContentsMargins(0, 0, gap, 0);
    rows->setSpacing(gap);
    actions_ = new QVBoxLayout;
    rows->addLayout(actions_);
    work_ = wrapped(side);
    progress_ = new QProgressBar(side);
    progress_->setRange(0, 1000);
    progress_->setTextVisible(false);
    progress_->setMaximumHeight(8);
    rows->addWidget(work_);
    rows->addWidget(progress_);
    body_ = new QVBoxLayout;
    rows->addLayout(body_);
    quality_section_ = new Section(tr("This picture"), side);
    quality_list_ = new CheckList(quality_section_);
    quality_section_->body()->addWidget(quality_list_);
    rows->addWidget(quality_section_);
    acceptance_section_ = new Section(tr("Needed to go on"), side);
    acceptance_list_ = new CheckList(acceptance_section_);
    acceptance_section_->body()->addWidget(acceptance_list_);
    rows->addWidget(acceptance_section_);
    advice_ = wrapped(side);
    override_note_ = wrapped(side);
    rows->addWidget(advice_);
    rows->addWidget(override_note_);
    rows->addStretch(1);

    auto* scroll = new QScrollArea(this);
    scroll->setWidget(side);
    scroll->setWidgetResizable(true);
    scroll->setFrameShape(QFrame::NoFrame);
    scroll->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    scroll->setFocusPolicy(Qt::NoFocus);
    // Room for a sentence of some forty letters in a line; not so wide that the picture suffers.
    scroll->setFixedWidth(std::min(42 * fontMetrics().averageCharWidth(), 460));

    auto* across = new QHBoxLayout;
    across->setSpacing(2 * gap);
    across->addWidget(picture_, 1);
    across->addWidget(scroll);
    auto* all = new QVBoxLayout(this);
    all->setContentsMargins(0, 0, 0, 0);
    all->setSpacing(gap);
    all->addWidget(instruction_);
    all->addLayout(across, 1);
    setIdle();
    setQuality({});
    showAcceptance();
}

QString WizardPage::instruction() const {
    return instruction_->text();
}

void WizardPage::setInstruction(const QString& instruction) {
    instruction_->setText(instruction);
}

void WizardPage::setPicture(QWidget* widget) {
    view_->hide();
    picture_box_->addWidget(widget);
}

QPushButton* WizardPage::addAction(const QString& text, std::function<void()> what) {
    auto* button = new QPushButton(text, this);
    if (buttons_.empty()) button->setProperty("primary", true);
    connect(button, &QPushButton::clicked, this, [what = std::move(what)] { what(); });
    actions_->addWidget(button);
    buttons_.push_back(button);
    return button;
}

QPushButton* WizardPage::primaryAction() const {
    for (QPushButton* button : buttons_)
        if (button->isEnabled() && !button->isHidden()) return button;
    return nullptr;
}

void WizardPage::setQuality(std::vector<CheckRow> rows) {
    quality_section_->setVisible(!rows.empty());
    quality_list_->setRows(rows);
    emit changed();
}

const std::vector<CheckRow>& WizardPage::quality() const {
    return quality_list_->rows();
}

void WizardPage::setAcceptance(Acceptance acceptance, const QString& advice) {
    acceptance_ = std::move(acceptance);
    problem_.clear();
    stale_.clear();
    override_.reset();
    advice_->setText(advice);
    showAcceptance();
    emit redone();
}

void WizardPage::setProblem(const QString& sentence) {
    const bool had = !acceptance_.empty();
    acceptance_.clear();
    problem_ = sentence;
    stale_.clear();
    override_.reset();
    advice_->clear();
    showAcceptance();
    if (had) emit redone();
}

void WizardPage::setNothingToMeasure() {
    nothing_to_measure_ = true;
    showAcceptance();
}

void WizardPage::setAdvice(const QString& advice) {
    setText(*advice_, advice, Tone::plain);
}

void WizardPage::setWorking(const QString& what, double fraction) {
    const bool began = !working_;
    working_ = true;
    setText(*work_, what, Tone::quiet);
    progress_->show();
    progress_->setValue(std::isfinite(fraction) ? static_cast<int>(std::lround(1000 * fraction)) : 0);
    if (!began) return;
    for (QPushButton* button : buttons_)
        button->setEnabled(false);
    emit changed();
}

void WizardPage::setIdle() {
    working_ = false;
    work_->hide();
    progress_->hide();
    for (QPushButton* button : buttons_)
        button->setEnabled(true);
    emit changed();
}

bool WizardPage::isMet() const {
    return stale_.isEmpty() && (nothing_to_measure_ || accepted(acceptance_));
}

Light WizardPage::light() const {
    if (working_) return Light::working;
    if (isMet()) return Light::met;
    if (!stale_.isEmpty() || override_) return Light::doubtful;
    return acceptance_.empty() && problem_.isEmpty() ? Light::unknown : Light::failed;
}

QString WizardPage::reason() const {
    if (working_) return tr("Something is still being worked out.");
    if (mayGoOn()) return {};
    if (!stale_.isEmpty()) return stale_;
    if (!problem_.isEmpty()) return problem_;
    for (const Judgement& one : acceptance_)
        if (!one.accepted()) return tr("Not yet: %1.").arg(QString::fromStdString(one.sentence()));
    return tr("Nothing has been measured yet.");
}

void WizardPage::setStale(const QString& because) {
    if (acceptance_.empty() || nothing_to_measure_) return;
    stale_ = because;
    override_.reset();
    showAcceptance();
}

bool WizardPage::mayBeOverridden() const {
    return !working_ && stale_.isEmpty() && !acceptance_.empty() && !isMet() && !override_;
}

void WizardPage::overrideLimits(Override by) {
    by.who = by.who.trimmed();
    by.why = by.why.trimmed();
    if (!mayBeOverridden() || by.who.isEmpty() || by.why.isEmpty())
        throw std::logic_error("override of " + id_.toStdString() + ": nothing to override, or no name and reason");
    override_ = std::move(by);
    showAcceptance();
}

void WizardPage::showAcceptance() {
    std::vector<CheckRow> rows;
    for (const Judgement& one : acceptance_)
        rows.push_back(rowOf(one));
    acceptance_list_->setRows(rows);
    acceptance_section_->setVisible(!nothing_to_measure_);
    const bool fine = problem_.isEmpty() && stale_.isEmpty();
    acceptance_section_->setState(!stale_.isEmpty()     ? stale_
                                  : !problem_.isEmpty() ? problem_
                                  : rows.empty()        ? tr("Not measured yet.")
                                                        : QString(),
                                  fine ? Tone::quiet : Tone::warning);
    setText(*advice_, advice_->text(), Tone::plain);
    setText(*override_note_, override_ ? tr("Overridden by %1: %2").arg(override_->who, override_->why) : QString(),
            Tone::warning);
    emit changed();
}

}  // namespace fluorocut::ui

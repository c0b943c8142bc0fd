#include "ui/wizards/wizard.h"

#include <QAbstractButton>
#include <QApplication>
#include <QFrame>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPointer>
#include <QPushButton>
#include <QShortcut>
#include <QStackedWidget>
#include <QVBoxLayout>
#include <QVariant>
#include <algorithm>

#include "ui/panels/navigator.h"
#include "ui/panels/section.h"

namespace fluorocut::ui {

Wizard::Wizard(const QString& title, QWidget* parent)
    : QWidget(parent),
      title_(title),
      steps_(new Navigator(this)),
      heading_(new QLabel(this)),
      why_locked_(new QLabel(this)),
      stack_(new QStackedWidget(this)),
      close_(new QPushButton(tr("&Close"), this)),
      back_(new QPushButton(tr("&Back"), this)),
      next_(new QPushButton(tr("&Next"), this)),
      override_(new QPushButton(tr("&Override..."), this)) {
    setObjectName("wizard");
    // The navigator is the procedure's elsewhere.
    steps_->setObjectName("wizardSteps");
    steps_->setAccessibleName(tr("Pages"));
    steps_->setMaximumWidth(30 * fontMetrics().averageCharWidth());
    steps_->setFocusPolicy(Qt::TabFocus);
    QFont large = heading_->font();
    large.setPointSizeF(1.5 * large.pointSizeF());
    large.setBold(true);
    heading_->setFont(large);
    heading_->setTextFormat(Qt::PlainText);
    why_locked_->setWordWrap(true);
    why_locked_->setTextFormat(Qt::PlainText);
    next_->setProperty("primary", true);
    override_panel_ = makeOverride();

    const int gap = fontMetrics().height() / 2;
    auto* buttons = new QHBoxLayout;
    buttons->setSpacing(gap);
    buttons->addWidget(close_);
    buttons->addWidget(why_locked_, 1);
    buttons->addWidget(override_);
    buttons->addWidget(back_);
    buttons->addWidget(next_);
    auto* column = new QVBoxLayout;
    column->setContentsMargins(2 * gap, gap, 2 * gap, gap);
    column->setSpacing(gap);
    column->addWidget(heading_);
    column->addWidget(stack_, 1);
    column->addWidget(override_panel_);
    column->addLayout(buttons);
    auto* all = new QHBoxLayout(this);
    all->setContentsMargins(0, 0, 0, 0);
    all->setSpacing(0);
    all->addWidget(steps_);
    all->addLayout(column, 1);

    connect(close_, &QPushButton::clicked, this, &Wizard::closeRequested);
    connect(back_, &QPushButton::clicked, this, &Wizard::back);
    connect(next_, &QPushButton::clicked, this, &Wizard::next);
    connect(override_, &QPushButton::clicked, this, [this] { askOverride(true); });
    connect(steps_, &Navigator::stepChosen, this, [this](int row) {
        if (mayReach(row)) goTo(row);
        follow();  // the list shows where we are, wherever was clicked
    });
    const auto key = [this](const QKeySequence& keys, auto&& does) {
        connect(new QShortcut(keys, this, nullptr, nullptr, Qt::WidgetWithChildrenShortcut), &QShortcut::activated,
                this, does);
    };
    key(QKeySequence("Alt+Left"), [this] { back(); });
    key(QKeySequence("Alt+Right"), [this] { next(); });
    key(QKeySequence(Qt::Key_Return), [this] { enter(); });
    key(QKeySequence(Qt::Key_Enter), [this] { enter(); });
    key(QKeySequence(Qt::Key_Escape), [this] { askOverride(false); });
    askOverride(false);
}

QFrame* Wizard::makeOverride() {
    auto* panel = new QFrame(this);
    panel->setAutoFillBackground(true);
    panel->setBackgroundRole(QPalette::Button);
    auto* text = new QLabel(tr("Go on against the limits? Your name and your reason are kept for good."), panel);
    text->setWordWrap(true);
    name_ = new QLineEdit(panel);
    name_->setPlaceholderText(tr("Your name"));
    name_->setAccessibleName(tr("Your name"));
    reason_ = new QLineEdit(panel);
    reason_->setPlaceholderText(tr("Reason"));
    reason_->setAccessibleName(tr("Reason"));
    confirm_ = new QPushButton(tr("Override the &limits"), panel);
    auto* dismiss = new QPushButton(tr("Do &not"), panel);
    auto* fields = new QHBoxLayout;
    fields->addWidget(name_, 1);
    fields->addWidget(reason_, 2);
    fields->addWidget(confirm_);
    fields->addWidget(dismiss);
    auto* rows = new QVBoxLayout(panel);
    rows->addWidget(text);
    rows->addLayout(fields);
    const auto allow = [this] {
        confirm_->setEnabled(!name_->text().trimmed().isEmpty() && !reason_->text().trimmed().isEmpty());
    };
    connect(name_, &QLineEdit::textChanged, this, allow);
    connect(reason_, &QLineEdit::textChanged, this, allow);
    connect(dismiss, &QPushButton::clicked, this, [this] { askOverride(false); });
    connect(confirm_, &QPushButton::clicked, this, [this] {
        if (!current().mayBeOverridden()) return;
        current().overrideLimits({name_->text(), reason_->text()});
        askOverride(false);
        next_->setFocus();
    });
    allow();
    return panel;
}

void Wizard::addPage(WizardPage* page) {
    const auto place = pages_.size();
    pages_.push_back(page);
    kept_.push_back(false);
    stack_->addWidget(page);
    connect(page, &WizardPage::changed, this, [this, place] {
        kept_[place] = false;
        follow();
    });
    connect(page, &WizardPage::redone, this, [this, place, page] {
        for (std::size_t later = place + 1; later < pages_.size(); ++later)
            pages_[later]->setStale(tr("\"%1\" was done again: measure this anew.").arg(page->title()));
    });
    if (place == 0)
        goTo(0);
    else
        follow();
}

bool Wizard::mayReach(int index) const {
    if (keeping_ || index < 0 || index >= pageCount()) return false;
    if (index <= index_) return true;
    // Forward past pages that are done; the first step goes through next(), so that it is kept.
    for (int i = index_; i < index; ++i)
        if (!page(i).mayGoOn() || !kept_[static_cast<std::size_t>(i)]) return false;
    return true;
}

void Wizard::goTo(int index) {
    index_ = index;
    stack_->setCurrentIndex(index);
    askOverride(false);
    current().entered();
    follow();
    QPushButton* first = current().primaryAction();
    if (!current().mayGoOn() && first)
        first->setFocus();
    else
        next_->setFocus();
    emit pageChanged(index);
}

void Wizard::next() {
    if (keeping_ || pages_.empty() || !current().mayGoOn()) return;
    const auto go_on = [this] {
        if (index_ + 1 < pageCount())
            goTo(index_ + 1);
        else
            emit finished();
    };
    const auto place = static_cast<std::size_t>(index_);
    if (kept_[place] || !keeper_ || (current().acceptance().empty() && !current().overriddenBy())) {
        kept_[place] = true;
        return go_on();
    }
    WizardDecision decision{current().id(), current().title(), current().acceptance(), current().isMet(), {}, {}};
    if (const auto& by = current().overriddenBy()) {
        decision.who = by->who;
        decision.why = by->why;
    }
    keeping_ = true;
    follow();
    keeper_(decision, [self = QPointer<Wizard>(this), place, go_on](const Result<void>& kept) {
        if (!self) return;
        self->keeping_ = false;
        self->follow();
        if (!kept) {
            setText(*self->why_locked_,
                    tr("This could not be kept: %1").arg(QString::fromStdString(kept.error().message())),
                    Tone::warning);
            return;
        }
        self->kept_[place] = true;
        go_on();
    });
}

void Wizard::back() {
    if (!keeping_ && index_ > 0) goTo(index_ - 1);
}

void Wizard::enter() {
    auto* button = qobject_cast<QAbstractButton*>(QApplication::focusWidget());
    if (button && isAncestorOf(button)) return button->click();
    if (override_panel_->isVisible()) return confirm_->click();
    if (current().mayGoOn()) return next();
    if (QPushButton* action = current().primaryAction()) action->click();
}

void Wizard::askOverride(bool ask) {
    override_panel_->setVisible(ask);
    if (ask) {
        reason_->clear();
        (name_->text().isEmpty() ? name_ : reason_)->setFocus();
    }
}

void Wizard::follow() {
    if (pages_.empty()) return;
    heading_->setText(tr("%1: %2 (%3 of %4)").arg(title_, current().title()).arg(index_ + 1).arg(pageCount()));
    setText(*why_locked_, keeping_ ? tr("Keeping what was decided...") : current().reason(), Tone::quiet);
    why_locked_->setVisible(true);  // it pushes the buttons apart
    next_->setText(index_ + 1 < pageCount() ? tr("&Next") : tr("&Finish"));
    next_->setEnabled(!keeping_ && current().mayGoOn());
    back_->setEnabled(!keeping_ && index_ > 0);
    override_->setVisible(current().mayBeOverridden());
    if (!current().mayBeOverridden()) askOverride(false);
    std::vector<NavigatorRow> rows;
    for (const WizardPage* one : pages_) {
        NavigatorRow row{one->title(), StepMark::waiting, {}};
        switch (one->light()) {
            case Light::working:
                row.mark = StepMark::running;
                break;
            case Light::met:
                // Where nothing is measured there is nothing to be proud of before one was there.
                row.mark = one->acceptance().empty() && one != &current() ? StepMark::ready : StepMark::accepted;
                break;
            case Light::doubtful:
                row.mark = one->overriddenBy() ? StepMark::done : StepMark::stale;
                break;
            case Light::failed:
                row.mark = StepMark::refused;
                break;
            case Light::unknown:
                if (one == &current()) row.mark = StepMark::ready;
                break;
        }
        if (one->overriddenBy()) row.detail = tr("overridden by %1").arg(one->overriddenBy()->who);
        rows.push_back(row);
    }
    steps_->setRows(rows);
    const QSignalBlocker quiet(steps_);
    steps_->setCurrentRow(index_);
}

void Wizard::resizeEvent(QResizeEvent* event) {
    QWidget::resizeEvent(event);
    // In large type the picture needs the room more; the heading tells where one is.
    steps_->setVisible(width() > 140 * fontMetrics().averageCharWidth());
}

}  // namespace fluorocut::ui

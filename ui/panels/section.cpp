#include "ui/panels/section.h"

#include <QLabel>
#include <QVBoxLayout>

#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {

void setText(QLabel& label, const QString& text, Tone tone) {
    QPalette palette = label.parentWidget() ? label.parentWidget()->palette() : label.palette();
    if (tone == Tone::quiet) palette.setColor(QPalette::WindowText, palette.color(QPalette::PlaceholderText));
    if (tone == Tone::warning) palette.setColor(QPalette::WindowText, colorOf(Ink::found));
    label.setPalette(palette);
    label.setText(text);
    label.setVisible(!text.isEmpty());
}

Section::Section(const QString& title, QWidget* parent) : QWidget(parent) {
    auto* all = new QVBoxLayout(this);
    all->setContentsMargins(0, 0, 0, 0);
    const int gap = fontMetrics().height() / 3;
    all->setSpacing(gap);
    auto* heading = new QLabel(title, this);
    QFont bold = heading->font();
    bold.setBold(true);
    heading->setFont(bold);
    all->addWidget(heading);
    state_ = new QLabel(this);
    state_->setWordWrap(true);
    state_->hide();
    all->addWidget(state_);
    body_ = new QVBoxLayout;
    body_->setSpacing(gap);
    all->addLayout(body_);
    auto* line = new QFrame(this);
    line->setFrameShape(QFrame::HLine);
    QPalette faint = line->palette();
    faint.setColor(QPalette::WindowText, faint.color(QPalette::Button));
    line->setPalette(faint);
    line->setFrameShadow(QFrame::Plain);
    all->addWidget(line);
}

void Section::setState(const QString& text, Tone tone) {
    setText(*state_, text, tone);
}

QString Section::stateText() const {
    return state_->text();
}

}  // namespace fluorocut::ui

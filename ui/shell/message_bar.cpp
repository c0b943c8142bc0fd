#include "ui/shell/message_bar.h"

#include <QHBoxLayout>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QStyle>
#include <cmath>

namespace fluorocut::ui {

MessageBar::MessageBar(QWidget* parent)
    : QFrame(parent),
      icon_(new QLabel(this)),
      text_(new QLabel(this)),
      progress_(new QProgressBar(this)),
      button_(new QPushButton(this)) {
    setObjectName("messageBar");
    setFrameShape(QFrame::NoFrame);
    setAutoFillBackground(true);
    setBackgroundRole(QPalette::Button);
    text_->setWordWrap(true);
    text_->setTextFormat(Qt::PlainText);  // file names are not markup
    text_->setTextInteractionFlags(Qt::TextSelectableByMouse);
    progress_->setRange(0, 1000);
    progress_->setTextVisible(false);
    progress_->setFixedWidth(220);
    progress_->setMaximumHeight(8);
    auto* row = new QHBoxLayout(this);
    row->setContentsMargins(10, 6, 10, 6);
    row->addWidget(icon_);
    row->addWidget(text_, 1);
    row->addWidget(progress_);
    row->addWidget(button_);
    connect(button_, &QPushButton::clicked, this, [this] {
        if (kind_ == Kind::progress)
            emit cancelRequested();
        else
            clear();
    });
    clear();
}

void MessageBar::show(Kind kind, const QString& text) {
    kind_ = kind;
    text_->setText(text);
    progress_->setVisible(kind == Kind::progress);
    const auto picture = kind == Kind::error ? QStyle::SP_MessageBoxWarning : QStyle::SP_MessageBoxInformation;
    icon_->setPixmap(style()->standardIcon(picture).pixmap(20, 20));
    button_->setText(kind == Kind::progress ? tr("Cancel") : tr("Close"));
    setVisible(kind != Kind::nothing);
}

void MessageBar::showError(const QString& sentence) {
    show(Kind::error, sentence);
}

void MessageBar::showNote(const QString& sentence) {
    show(Kind::note, sentence);
}

void MessageBar::showProgress(const QString& what, double fraction, const QString& label) {
    const QString text = label.isEmpty() ? what : what + ": " + label;
    if (kind_ != Kind::progress)
        show(Kind::progress, text);
    else
        text_->setText(text);
    progress_->setValue(std::isfinite(fraction) ? static_cast<int>(std::lround(1000 * fraction)) : 0);
}

void MessageBar::clear() {
    show(Kind::nothing, {});
}

QString MessageBar::sentence() const {
    return kind_ == Kind::nothing ? QString() : text_->text();
}

}  // namespace fluorocut::ui

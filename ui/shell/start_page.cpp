#include "ui/shell/start_page.h"

#include <QDateTime>
#include <QFileInfo>
#include <QFontMetrics>
#include <QHBoxLayout>
#include <QLabel>
#include <QLocale>
#include <QPushButton>
#include <QVBoxLayout>
#include <algorithm>

namespace fluorocut::ui {
namespace {

QLabel* paragraph(const QString& text, QWidget* parent, double scale = 1, bool bold = false) {
    auto* label = new QLabel(text, parent);
    label->setWordWrap(true);
    QFont font = label->font();
    font.setPointSizeF(font.pointSizeF() * scale);
    font.setBold(bold);
    label->setFont(font);
    return label;
}

}  // namespace

StartPage::StartPage(QWidget* parent) : QWidget(parent) {
    setAutoFillBackground(true);
    setBackgroundRole(QPalette::Base);
    auto* column = new QWidget(this);
    column->setMinimumWidth(44 * fontMetrics().horizontalAdvance("m"));
    auto* rows = new QVBoxLayout(column);
    rows->setSpacing(10);

    rows->addWidget(paragraph("FluoroCut", column, 2.6, true));
    rows->addWidget(paragraph(
        tr("Plan the cavity of a new femoral stem in C-arm images, mill it by robot, stage by stage."), column, 1.25));
    auto* notice = paragraph(tr("Research software, not a medical device."), column);
    notice->setForegroundRole(QPalette::PlaceholderText);
    rows->addWidget(notice);
    rows->addSpacing(18);

    auto* buttons = new QHBoxLayout;
    buttons->setSpacing(10);
    sample_ = new QPushButton(tr("Open the sample case"), column);
    sample_->setProperty("primary", true);
    sample_->setDefault(true);
    sample_->setToolTip(tr("A simulated hip with six registered views and a planned stem"));
    open_ = new QPushButton(tr("Open files..."), column);
    open_->setToolTip(tr("Images, a CT, an implant's mesh, or a saved case"));
    buttons->addWidget(sample_);
    buttons->addWidget(open_);
    buttons->addStretch(1);
    rows->addLayout(buttons);
    auto* hint =
        paragraph(tr("Or drop images, a CT, an implant's mesh or a saved case anywhere on this window."), column);
    hint->setForegroundRole(QPalette::PlaceholderText);
    rows->addWidget(hint);
    rows->addSpacing(18);

    recent_title_ = paragraph(tr("Recent"), column, 1.15, true);
    rows->addWidget(recent_title_);
    recent_list_ = new QVBoxLayout;
    recent_list_->setSpacing(2);
    rows->addLayout(recent_list_);

    auto* middle = new QHBoxLayout;
    middle->addStretch(1);
    middle->addWidget(column);
    middle->addStretch(1);
    auto* page = new QVBoxLayout(this);
    page->addStretch(2);
    page->addLayout(middle);
    page->addStretch(3);

    connect(sample_, &QPushButton::clicked, this, &StartPage::sampleRequested);
    connect(open_, &QPushButton::clicked, this, &StartPage::openRequested);
    setRecent({});
}

void StartPage::setRecent(const QStringList& files) {
    // Later: the click that led here may come from one of them.
    for (QPushButton* button : recent_) {
        recent_list_->removeWidget(button);
        button->hide();
        button->deleteLater();
    }
    recent_.clear();
    recent_title_->setVisible(!files.isEmpty());
    for (const QString& file : files) {
        const QFileInfo info(file);
        auto* button = new QPushButton(this);
        button->setFlat(true);
        button->setCursor(Qt::PointingHandCursor);
        button->setStyleSheet("text-align: left; padding: 5px 8px;");
        const QString when = QLocale().toString(info.lastModified(), QLocale::ShortFormat);
        const int room = 26 * fontMetrics().horizontalAdvance("m");
        // & is a mnemonic in a button's text.
        const QString name = fontMetrics().elidedText(info.fileName(), Qt::ElideMiddle, room);
        button->setText(QString(name).replace("&", "&&") + "   " + when);
        button->setToolTip(file);
        connect(button, &QPushButton::clicked, this, [this, file] { emit recentRequested(file); });
        recent_list_->addWidget(button);
        recent_ << button;
    }
}

}  // namespace fluorocut::ui

#include "ui/shell/help_window.h"

#include <QFile>
#include <QFileInfo>
#include <QHBoxLayout>
#include <QListWidget>
#include <QSplitter>
#include <QTextBrowser>
#include <QUrl>

#include "core/io/resources.h"

namespace fluorocut::ui {
namespace {

QString folder() {
    const auto resources = resourceFolder();
    return resources ? QString::fromStdString((*resources / "help").string()) : QString();
}

// The first heading.
QString titleOf(const QString& page) {
    QFile file(folder() + "/" + page + ".md");
    if (!file.open(QIODevice::ReadOnly)) return page;
    return QString::fromUtf8(file.readLine()).remove('#').trimmed();
}

}  // namespace

QStringList HelpWindow::pages() {
    return {"start", "images",    "planning", "overlays",  "measuring",
            "scene", "procedure", "files",    "shortcuts", "safety"};
}

QString HelpWindow::pageOf(const QWidget* place) {
    for (; place != nullptr; place = place->parentWidget()) {
        const QString page = place->property("helpPage").toString();
        if (!page.isEmpty()) return page;
    }
    return "start";
}

HelpWindow::HelpWindow(QWidget* parent)
    : QDialog(parent), list_(new QListWidget(this)), browser_(new QTextBrowser(this)) {
    setObjectName("help");
    setWindowTitle(tr("FluoroCut: help"));
    setModal(false);
    resize(900, 640);
    list_->setFrameShape(QFrame::NoFrame);
    list_->setAccessibleName(tr("Pages"));
    browser_->setFrameShape(QFrame::NoFrame);
    browser_->document()->setDocumentMargin(18);
    browser_->setOpenExternalLinks(false);
    for (const QString& page : pages())
        list_->addItem(titleOf(page));
    auto* split = new QSplitter(this);
    split->addWidget(list_);
    split->addWidget(browser_);
    split->setStretchFactor(1, 1);
    split->setSizes({200, 700});
    split->setChildrenCollapsible(false);
    auto* row = new QHBoxLayout(this);
    row->setContentsMargins(0, 0, 0, 0);
    row->addWidget(split);
    connect(list_, &QListWidget::currentRowChanged, this, [this](int index) {
        if (index >= 0) showPage(pages().at(index));
    });
    // Links lead to other pages.
    connect(browser_, &QTextBrowser::sourceChanged, this, [this](const QUrl& url) {
        page_ = QFileInfo(url.path()).completeBaseName();
        const QSignalBlocker quiet(list_);
        list_->setCurrentRow(static_cast<int>(pages().indexOf(page_)));
    });
    showPage("start");
}

void HelpWindow::showPage(const QString& page) {
    const QString file = folder() + "/" + page + ".md";
    if (!QFileInfo::exists(file)) {
        browser_->setPlainText(tr("The help page \"%1\" is missing: %2").arg(page, file));
        return;
    }
    browser_->setSource(QUrl::fromLocalFile(file));
}

QString HelpWindow::text() const {
    return browser_->toPlainText();
}

}  // namespace fluorocut::ui

#include "ui/shell/main_window.h"

#include <QAction>
#include <QApplication>
#include <QFileDialog>
#include <QGridLayout>
#include <QLabel>
#include <QMenuBar>
#include <QMessageBox>
#include <QStatusBar>
#include <algorithm>
#include <cmath>
#include <utility>

#include "ui/session/job_runner.h"
#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {

MainWindow::MainWindow(QWidget* parent) : QMainWindow(parent), jobs_(new JobRunner(this)) {
    auto* sheet = new QWidget(this);
    grid_ = new QGridLayout(sheet);
    grid_->setContentsMargins(2, 2, 2, 2);
    grid_->setSpacing(2);
    setCentralWidget(sheet);

    hint_ = new QLabel(tr("Left drag: window and level   Wheel: zoom   Middle drag: pan   F: fit   M: mirror   I: invert"), this);
    hint_->setContentsMargins(8, 3, 8, 3);
    statusBar()->addWidget(hint_);
    auto* notice = new QLabel(tr("Research software, not a medical device"), this);
    notice->setContentsMargins(8, 3, 8, 3);
    statusBar()->addPermanentWidget(notice);
    statusBar()->setSizeGripEnabled(false);

    makeMenus();
    resize(1120, 640);
    setWindowTitle(tr("FluoroCut (research software, not a medical device)"));

    connect(jobs_, &JobRunner::progressed, this, [this](double fraction, const QString& label) {
        const QString text = label.isEmpty() ? waiting_ : waiting_ + "\n" + label;
        for (ImageView* view : views_)
            view->setMessage(text, fraction);
    });
    connect(jobs_, &JobRunner::crashed, this, [this](const QString& what) {
        finish(noSolution("FluoroCut", "a fault of its own (" + what.toStdString() + ")", "none", "please report it"));
    });
}

void MainWindow::makeMenus() {
    QMenu* file = menuBar()->addMenu(tr("&File"));
    QAction* open = file->addAction(tr("&Open images..."));
    open->setShortcut(QKeySequence::Open);
    connect(open, &QAction::triggered, this, [this] {
        const QStringList files = QFileDialog::getOpenFileNames(this, tr("Open images"));
        if (!files.isEmpty()) emit openRequested(files);
    });
    QAction* quit = file->addAction(tr("&Quit"));
    quit->setShortcut(QKeySequence::Quit);
    connect(quit, &QAction::triggered, this, &QWidget::close);

    QMenu* view = menuBar()->addMenu(tr("&View"));
    QAction* fit = view->addAction(tr("&Fit all"));
    fit->setShortcut(QKeySequence("Ctrl+0"));
    connect(fit, &QAction::triggered, this, [this] {
        for (ImageView* each : views_)
            each->fit();
    });
    QAction* reset = view->addAction(tr("&Automatic window in all"));
    reset->setShortcut(QKeySequence("Ctrl+R"));
    connect(reset, &QAction::triggered, this, [this] {
        for (ImageView* each : views_)
            each->resetDisplayWindow();
    });

    QMenu* help = menuBar()->addMenu(tr("&Help"));
    connect(help->addAction(tr("&About FluoroCut")), &QAction::triggered, this, [this] {
        QMessageBox::about(this, tr("About FluoroCut"),
                           tr("FluoroCut %1\n\nC-arm guided planning and robotic milling of the femoral cavity.\n\n"
                              "Research software, not a medical device.")
                               .arg(QApplication::applicationVersion()));
    });
}

void MainWindow::setViewCount(int count) {
    for (ImageView* view : views_)
        delete view;
    views_.clear();
    // As many columns as rows or one more.
    const int columns = std::max(1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(count)))));
    for (int i = 0; i < count; ++i) {
        views_.push_back(new ImageView(this));
        grid_->addWidget(views_.back(), i / columns, i % columns);
    }
}

void MainWindow::setMessages(const QString& message) {
    for (ImageView* view : views_)
        view->setMessage(message);
}

void MainWindow::show(const QString& subject, const QString& waiting, int expected_images, MakeImages make) {
    setWindowTitle(tr("%1 - FluoroCut (research software, not a medical device)").arg(subject));
    setViewCount(std::max(1, expected_images));
    waiting_ = waiting;
    setMessages(waiting);
    next_ = std::move(make);
    if (jobs_->isBusy()) {
        jobs_->cancel();  // finish() of that one starts this one
    } else {
        startNext();
    }
}

void MainWindow::startNext() {
    jobs_->run<std::vector<TitledImage>>(
        std::exchange(next_, nullptr), [this](Result<std::vector<TitledImage>> images) { finish(std::move(images)); });
}

void MainWindow::finish(Result<std::vector<TitledImage>> images) {
    if (next_) {
        startNext();
        return;
    }
    if (!images) {
        const QString sentence = QString::fromStdString(images.error().message());
        setMessages(sentence);
        emit shown(false, sentence);
        return;
    }
    if (images->size() != views_.size()) setViewCount(static_cast<int>(images->size()));
    for (std::size_t i = 0; i < views_.size(); ++i)
        views_[i]->setImage((*images)[i].image, (*images)[i].title);
    emit shown(true, {});
}

}  // namespace fluorocut::ui

#include "ui/shell/main_window.h"

#include <QAction>
#include <QApplication>
#include <QCloseEvent>
#include <QDateTime>
#include <QDockWidget>
#include <QDragEnterEvent>
#include <QFileInfo>
#include <QLabel>
#include <QMimeData>
#include <QPushButton>
#include <QStackedWidget>
#include <QStatusBar>
#include <QUrl>
#include <QVBoxLayout>
#include <utility>

#include "ui/panels/measure_tool.h"
#include "ui/panels/navigator.h"
#include "ui/panels/plan_inspector.h"
#include "ui/panels/planning_tool.h"
#include "ui/scene/scene_view.h"
#include "ui/session/autosave.h"
#include "ui/session/case_files.h"
#include "ui/session/job_runner.h"
#include "ui/session/session.h"
#include "ui/shell/case_steps.h"
#include "ui/shell/help_window.h"
#include "ui/shell/message_bar.h"
#include "ui/shell/settings.h"
#include "ui/shell/start_page.h"
#include "ui/spreadsheet/sheet.h"

namespace fluorocut::ui {
namespace {

constexpr int kLayoutVersion = 1;

// "3 days ago" matters, not the minute.
QString ageOf(const std::string& utc) {
    const QDateTime then = QDateTime::fromString(QString::fromStdString(utc), Qt::ISODateWithMs);
    if (!then.isValid()) return {};
    const qint64 days = then.daysTo(QDateTime::currentDateTimeUtc());
    if (days <= 0) return MainWindow::tr("today");
    return MainWindow::tr("%n day(s) ago", nullptr, static_cast<int>(days));
}

}  // namespace

MainWindow::MainWindow(Session& session, Settings& settings, MakeCase sample, QWidget* parent)
    : QMainWindow(parent),
      session_(session),
      settings_(settings),
      sample_(std::move(sample)),
      autosave_(new Autosave(session, settings.caseFolder().toStdString(), this)),
      jobs_(new JobRunner(this)),
      messages_(new MessageBar(this)),
      pages_(new QStackedWidget(this)),
      start_(new StartPage(this)),
      navigator_(new Navigator(this)) {
    setAcceptDrops(true);
    setDockNestingEnabled(true);
    auto* center = new QWidget(this);
    auto* rows = new QVBoxLayout(center);
    rows->setContentsMargins(0, 0, 0, 0);
    rows->setSpacing(0);
    rows->addWidget(messages_);
    rows->addWidget(pages_, 1);
    setCentralWidget(center);

    makePanels();
    makeFileMenu();
    makeEditMenu();
    makeViewMenu();
    makeHelpMenu();
    makeStatusBar();

    connect(start_, &StartPage::sampleRequested, this, &MainWindow::openSample);
    connect(start_, &StartPage::openRequested, this, &MainWindow::chooseFiles);
    connect(start_, &StartPage::recentRequested, this, [this](const QString& file) { openFiles({file}); });
    connect(&settings_, &Settings::recentChanged, this, &MainWindow::followRecent);
    connect(&settings_, &Settings::lookChanged, this, &MainWindow::applyLook);
    connect(&session_, &Session::changed, this, &MainWindow::follow);
    connect(messages_, &MessageBar::cancelRequested, jobs_, &JobRunner::cancel);
    connect(jobs_, &JobRunner::progressed, this, [this](double fraction, const QString& label) {
        if (jobs_->isBusy()) messages_->showProgress(doing_, fraction, label);
    });
    connect(jobs_, &JobRunner::crashed, this, [this](const QString& what) {
        done(false, tr("FluoroCut has a fault of its own (%1); please report it.").arg(what));
    });
    connect(autosave_, &Autosave::saved, this, [this] {
        saved_->setText(autosave_->pending() > 0 ? tr("Saving...") : tr("Saved"));
        saved_->setToolTip(QString::fromStdString(autosave_->file().string()));
        if (autosave_->pending() == 0 && !autosave_->file().empty())
            settings_.addRecent(QString::fromStdString(autosave_->file().string()));
    });
    connect(autosave_, &Autosave::failed, this, [this](const QString& sentence) {
        saved_->setText(tr("Not saved"));
        messages_->showError(tr("The case could not be saved: %1").arg(sentence));
    });
    connect(&session_, &Session::committedTo, this, [this] { saved_->setText(tr("Saving...")); });

    resize(1280, 800);
    first_layout_ = saveState(kLayoutVersion);
    restoreLayout();
    followRecent();
    follow();
    showStart();
}

MainWindow::~MainWindow() {
    // Its signals come while it waits for what it writes: nobody is there to hear them.
    autosave_->disconnect(this);
    jobs_->disconnect(this);
}

void MainWindow::makePanels() {
    pages_->addWidget(start_);
    sheet_ = new Sheet(session_, this);
    // A sheet of another time stays as it is usual: what is said of it is not worth a sentence at the start.
    (void)sheet_->restore(settings_.store());
    measuring_ = new MeasureChoice(this);
    pages_->addWidget(sheet_);
    start_->setProperty("helpPage", "start");
    sheet_->setProperty("helpPage", "images");

    const auto dock = [this](const QString& name, const QString& title, QWidget* widget, Qt::DockWidgetArea area) {
        auto* made = new QDockWidget(title, this);
        made->setObjectName(name);
        made->setWidget(widget);
        addDockWidget(area, made);
        docks_.push_back(made);
        return made;
    };
    dock("procedure", tr("Procedure"), navigator_, Qt::LeftDockWidgetArea);
    navigator_->setProperty("helpPage", "procedure");
    auto* inspector = new PlanInspector(session_, *measuring_, this);
    inspector->setProperty("helpPage", "planning");
    dock("plan", tr("Plan"), inspector, Qt::RightDockWidgetArea);
    const auto kept = [inspector] { return inspector->keptPoint(); };
    connect(inspector, &PlanInspector::keptPointChanged, this, [this, kept] { giveTools(kept()); });
    giveTools(kept());
    scene_ = new SceneView(session_, this);
    scene_->setProperty("helpPage", "scene");
    dock("scene", tr("3D"), scene_, Qt::RightDockWidgetArea);
    // The plan has a scroll bar, the scene has not.
    resizeDocks({docks_[1], docks_[2]}, {55, 45}, Qt::Vertical);
}

void MainWindow::giveTools(KeptPoint kept) {
    sheet_->setTools([this, kept](std::size_t view) -> std::unique_ptr<ViewTool> {
        auto tool = std::make_unique<PlanningTool>(session_, *measuring_, ImagePlace{view});
        tool->implant().setKeptPoint(kept);
        return tool;
    });
}

void MainWindow::makeStatusBar() {
    const auto label = [this](const QString& what, bool permanent = false) {
        auto* made = new QLabel(this);
        made->setContentsMargins(8, 3, 8, 3);
        made->setTextFormat(Qt::PlainText);
        made->setAccessibleName(what);
        if (permanent)
            statusBar()->addPermanentWidget(made);
        else
            statusBar()->addWidget(made);
        return made;
    };
    patient_ = label(tr("Patient and side"));
    calibration_ = label(tr("Calibration"));
    robot_ = label(tr("Robot"));
    saved_ = label(tr("Saved"));
    label(tr("Notice"), true)->setText(tr("Research software, not a medical device"));
    statusBar()->setSizeGripEnabled(false);
    robot_->setText(tr("Robot: not connected"));
}

void MainWindow::follow() {
    const CaseState& state = *session_.state();
    navigator_->setRows(stepsOf(state));
    const QString patient = QString::fromStdString(state.patient), side = QString::fromStdString(state.side);
    patient_->setText(patient.isEmpty() ? tr("No patient")
                      : side.isEmpty()  ? tr("%1, side unknown").arg(patient)
                      : side == "left"  ? tr("%1, left").arg(patient)
                                        : tr("%1, right").arg(patient));
    const QString age = ageOf(state.calibrated_utc);
    calibration_->setText(age.isEmpty() ? tr("C-arm not calibrated") : tr("C-arm calibrated %1").arg(age));
    const QString program = tr("FluoroCut (research software, not a medical device)");
    setWindowTitle(showsStart() || case_name_.isEmpty() ? program : tr("%1 - %2").arg(case_name_, program));
}

void MainWindow::start(const QString& what, std::function<void()> job) {
    doing_ = what;
    messages_->showProgress(what, 0, {});
    if (jobs_->isBusy()) {
        next_ = std::move(job);
        jobs_->cancel();  // done() of that one starts this one
    } else {
        job();
    }
}

void MainWindow::done(bool ok, const QString& sentence) {
    if (next_) {
        std::exchange(next_, nullptr)();
        return;
    }
    if (ok) {
        messages_->clear();
        showCase();
    } else {
        messages_->showError(sentence);
    }
    emit opened(ok, sentence);
}

void MainWindow::openSample() {
    start(tr("Opening the sample case"), [this] {
        jobs_->run<CaseState>(sample_, [this](Result<CaseState> state) {
            if (!state) return done(false, QString::fromStdString(state.error().message()));
            if (!next_) {
                case_name_ = tr("Sample case");
                session_.open(std::move(*state));
                saved_->clear();
            }
            done(true, {});
        });
    });
}

void MainWindow::openFiles(const QStringList& files) {
    if (files.isEmpty()) return;
    const QString name = files.size() == 1 ? QFileInfo(files.first()).fileName()
                                           : tr("%n file(s)", nullptr, static_cast<int>(files.size()));
    start(tr("Opening %1").arg(name), [this, files, name] {
        std::vector<std::filesystem::path> paths;
        for (const QString& file : files)
            paths.emplace_back(file.toStdString());
        const auto work = [paths](Progress& progress) { return readCaseFiles(paths, progress); };
        jobs_->run<ReadFiles>(work, [this, files, name](Result<ReadFiles> read) {
            if (!read) return done(false, QString::fromStdString(read.error().message()));
            if (!next_) {
                const bool begins = showsStart() || read->whole;
                if (begins) {
                    case_name_ = name;
                    session_.open(read->addedTo(CaseState{}));
                    saved_->clear();
                    if (read->whole) autosave_->goOnIn(read->case_file);
                } else {
                    session_.commit(tr("Open %1").arg(name), read->addedTo(*session_.committed()));
                }
                for (const QString& file : files)
                    settings_.addRecent(file);
            }
            const QString notes = read->notes.empty() ? QString() : QString::fromStdString(read->notes.front());
            done(true, {});
            if (!notes.isEmpty()) messages_->showNote(notes);
        });
    });
}

void MainWindow::showStart() {
    pages_->setCurrentIndex(0);
    for (QDockWidget* dock : docks_)
        dock->hide();
    start_->sampleButton()->setFocus();
    follow();
}

void MainWindow::showCase() {
    if (!showsStart()) return follow();
    pages_->setCurrentIndex(1);
    restoreLayout();
    pages_->currentWidget()->setFocus();
    follow();
}

bool MainWindow::showsStart() const {
    return pages_->currentIndex() == 0;
}

void MainWindow::arrangeFor(const QString& part) {
    showCase();
    restoreState(first_layout_, kLayoutVersion);
    if (part == "procedure") navigator_->setCurrentRow(3);
    if (part == "scene") {
        docks_[0]->hide();
        docks_[1]->hide();
        resizeDocks({docks_[2]}, {width() * 3 / 5}, Qt::Horizontal);
    }
    if (part == "planning" || part == "or-mode") {
        for (const Column& column : sheet_->columns())
            if (column.kind == "plan") sheet_->maximise({0, column.id});
    }
    if (part == "or-mode") docks_[2]->hide();
}

bool MainWindow::isWorking() const {
    return jobs_->isBusy() || !sheet_->engine().isIdle() || scene_->isPreparing();
}

void MainWindow::showHelp() {
    const QString page = HelpWindow::pageOf(QApplication::focusWidget());
    if (help_ == nullptr) help_ = new HelpWindow(this);
    help_->showPage(page);
    help_->show();
    help_->raise();
}

void MainWindow::closeEvent(QCloseEvent* event) {
    if (!showsStart()) settings_.setLayout("state", saveState(kLayoutVersion));
    settings_.setLayout("geometry", saveGeometry());
    sheet_->save(settings_.store());
    jobs_->cancel();
    next_ = nullptr;
    event->accept();
}

void MainWindow::dragEnterEvent(QDragEnterEvent* event) {
    for (const QUrl& url : event->mimeData()->urls())
        if (url.isLocalFile()) return event->acceptProposedAction();
}

void MainWindow::dropEvent(QDropEvent* event) {
    QStringList files;
    for (const QUrl& url : event->mimeData()->urls())
        if (url.isLocalFile()) files << url.toLocalFile();
    if (files.isEmpty()) return;
    event->acceptProposedAction();
    openFiles(files);
}

void MainWindow::restoreLayout() {
    restoreGeometry(settings_.layout("geometry"));
    if (!restoreState(settings_.layout("state"), kLayoutVersion)) restoreState(first_layout_, kLayoutVersion);
}

void MainWindow::resetLayout() {
    settings_.setLayout("state", {});
    if (!showsStart()) restoreState(first_layout_, kLayoutVersion);
}

void MainWindow::followRecent() {
    start_->setRecent(settings_.recentFiles());
}

void MainWindow::applyLook(Look look) {
    applyTheme(*qobject_cast<QApplication*>(QApplication::instance()), look);
    for (QAction* action : looks_->actions())
        action->setChecked(action->data().toInt() == static_cast<int>(look));
}

}  // namespace fluorocut::ui

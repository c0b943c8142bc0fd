// The main window: lays out what others draw, and has the actions. It opens files and the sample case by jobs that
// block nothing, says what went wrong in a bar, and keeps what the person set. It holds no algorithm.
#pragma once

#include <QMainWindow>
#include <QStringList>
#include <functional>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "ui/session/case_state.h"

class QActionGroup;
class QLabel;
class QMenu;
class QStackedWidget;

namespace fluorocut {
enum class KeptPoint;
}

namespace fluorocut::ui {

class Autosave;
class HelpWindow;
class JobRunner;
class MeasureChoice;
class MessageBar;
class Navigator;
class SceneView;
class Session;
class Settings;
class Sheet;
class StartPage;
enum class Look;

using MakeCase = std::function<Result<CaseState>(Progress&)>;

class MainWindow : public QMainWindow {
    Q_OBJECT

  public:
    // `sample` makes the sample case; it runs on a thread of its own.
    MainWindow(Session& session, Settings& settings, MakeCase sample, QWidget* parent = nullptr);
    ~MainWindow() override;

    // While a job runs, it is cancelled first and this one follows it.
    void openSample();
    void openFiles(const QStringList& files);

    void showStart();
    void showCase();
    bool showsStart() const;
    // Makes room for one part of a case: "planning", "scene", "procedure"; any other: the usual layout.
    void arrangeFor(const QString& part);
    // Something that follows from the case is still being worked out: pictures, the bone's surface.
    bool isWorking() const;
    // The page of the place that has the focus.
    void showHelp();
    HelpWindow* help() const { return help_; }

    Autosave& autosave() { return *autosave_; }
    MessageBar& messages() { return *messages_; }
    StartPage& startPage() { return *start_; }
    Navigator& navigator() { return *navigator_; }
    Sheet& sheet() { return *sheet_; }

  signals:
    // The latest job is done: what it opened is shown, or its error's sentence is.
    void opened(bool ok, const QString& sentence);

  protected:
    void closeEvent(QCloseEvent* event) override;
    void dragEnterEvent(QDragEnterEvent* event) override;
    void dropEvent(QDropEvent* event) override;

  private:
    void makePanels();
    void giveTools(KeptPoint kept);
    void makeFileMenu();
    void makeEditMenu();
    void makeViewMenu();
    void makeHelpMenu();
    void makeStatusBar();
    void follow();
    void followRecent();
    void applyLook(Look look);
    void restoreLayout();
    void resetLayout();

    // Runs `job`, which starts a job on jobs_; later when another one runs.
    void start(const QString& what, std::function<void()> job);
    void done(bool ok, const QString& sentence);
    void chooseFiles();
    void chooseSaveAs();

    Session& session_;
    Settings& settings_;
    MakeCase sample_;
    Autosave* autosave_;
    JobRunner* jobs_;
    std::function<void()> next_;
    QString doing_, case_name_;

    MessageBar* messages_;
    QStackedWidget* pages_;
    StartPage* start_;
    Sheet* sheet_ = nullptr;
    MeasureChoice* measuring_ = nullptr;
    SceneView* scene_ = nullptr;
    Navigator* navigator_;
    HelpWindow* help_ = nullptr;
    QMenu* recent_ = nullptr;
    QActionGroup* looks_ = nullptr;
    std::vector<QDockWidget*> docks_;
    QByteArray first_layout_;
    QLabel *patient_, *calibration_, *robot_, *saved_;
};

}  // namespace fluorocut::ui

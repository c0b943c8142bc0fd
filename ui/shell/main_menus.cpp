// The main window's actions.
#include <QAction>
#include <QActionGroup>
#include <QApplication>
#include <QDockWidget>
#include <QFileDialog>
#include <QMenu>
#include <QMenuBar>
#include <QMessageBox>

#include "ui/session/autosave.h"
#include "ui/session/session.h"
#include "ui/shell/help_window.h"
#include "ui/shell/main_window.h"
#include "ui/shell/message_bar.h"
#include "ui/shell/settings.h"
#include "ui/shell/settings_dialog.h"
#include "ui/shell/shortcuts_dialog.h"
#include "ui/shell/start_page.h"

namespace fluorocut::ui {

void MainWindow::makeFileMenu() {
    QMenu* file = menuBar()->addMenu(tr("&File"));
    QAction* open = file->addAction(tr("&Open..."), this, &MainWindow::chooseFiles);
    open->setShortcut(QKeySequence::Open);
    recent_ = file->addMenu(tr("Open &recent"));
    connect(recent_, &QMenu::aboutToShow, this, [this] {
        recent_->clear();
        for (const QString& path : settings_.recentFiles())
            recent_->addAction(QString(path).replace("&", "&&"), this, [this, path] { openFiles({path}); });
        recent_->addSeparator();
        recent_->addAction(tr("&Clear this list"), &settings_, &Settings::clearRecent)
            ->setEnabled(!settings_.recentFiles().isEmpty());
    });
    QAction* sample = file->addAction(tr("Open the &sample case"), this, &MainWindow::openSample);
    sample->setShortcut(QKeySequence("Ctrl+Shift+O"));
    QAction* save_as = file->addAction(tr("Save case &as..."), this, &MainWindow::chooseSaveAs);
    save_as->setShortcut(QKeySequence("Ctrl+Shift+S"));
    file->addSeparator();
    file->addAction(tr("S&ettings..."), this,
                    [this] {
                        auto* dialog = new SettingsDialog(settings_, this);
                        dialog->setAttribute(Qt::WA_DeleteOnClose);
                        dialog->show();
                    })
        ->setShortcut(QKeySequence("Ctrl+,"));
    file->addSeparator();
    file->addAction(tr("&Quit"), this, &QWidget::close)->setShortcut(QKeySequence("Ctrl+Q"));
}

void MainWindow::makeEditMenu() {
    QMenu* edit = menuBar()->addMenu(tr("&Edit"));
    QAction* undo = edit->addAction(tr("&Undo"), &session_, &Session::undo);
    undo->setObjectName("undo");
    undo->setShortcut(QKeySequence("Ctrl+Z"));
    QAction* redo = edit->addAction(tr("&Redo"), &session_, &Session::redo);
    redo->setObjectName("redo");
    redo->setShortcut(QKeySequence("Ctrl+Shift+Z"));
    const auto follow = [this, undo, redo] {
        undo->setEnabled(session_.canUndo() || session_.isPreviewing());
        redo->setEnabled(session_.canRedo());
        undo->setText(session_.canUndo() ? tr("&Undo: %1").arg(session_.undoText()) : tr("&Undo"));
        redo->setText(session_.canRedo() ? tr("&Redo: %1").arg(session_.redoText()) : tr("&Redo"));
    };
    connect(&session_, &Session::changed, this, follow);
    follow();
}

void MainWindow::makeViewMenu() {
    QMenu* view = menuBar()->addMenu(tr("&View"));
    view->addAction(tr("&Start page"), this, &MainWindow::showStart)->setShortcut(QKeySequence("Ctrl+Home"));
    view->addAction(tr("&Case"), this, &MainWindow::showCase)->setShortcut(QKeySequence("Ctrl+End"));
    view->addSeparator();
    for (QDockWidget* dock : docks_)
        view->addAction(dock->toggleViewAction());
    view->addAction(tr("&Reset layout"), this, &MainWindow::resetLayout);
    view->addSeparator();
    QMenu* look = view->addMenu(tr("&Look"));
    looks_ = new QActionGroup(this);
    const std::pair<Look, QString> names[] = {
        {Look::dark, tr("&Dark")}, {Look::light, tr("&Light")}, {Look::operatingRoom, tr("&Operating room (large)")}};
    for (const auto& [each, name] : names) {
        QAction* action = look->addAction(name, this, [this, each = each] { settings_.setLook(each); });
        action->setCheckable(true);
        action->setData(static_cast<int>(each));
        action->setChecked(each == settings_.look());
        looks_->addAction(action);
    }
    QAction* full = view->addAction(tr("&Full screen"), this, [this](bool on) {
        setWindowState(on ? windowState() | Qt::WindowFullScreen : windowState() & ~Qt::WindowFullScreen);
    });
    full->setCheckable(true);
    full->setShortcut(QKeySequence("F11"));
}

void MainWindow::makeHelpMenu() {
    QMenu* help = menuBar()->addMenu(tr("&Help"));
    help->addAction(tr("&Help for this place"), this, &MainWindow::showHelp)->setShortcut(QKeySequence("F1"));
    help->addAction(tr("&Shortcuts"), this,
                    [this] {
                        std::vector<Shortcut> shortcuts = shortcutsOf(*this);
                        for (Shortcut& each : shortcutsInImages())
                            shortcuts.push_back(std::move(each));
                        auto* dialog = new ShortcutsDialog(shortcuts, this);
                        dialog->setAttribute(Qt::WA_DeleteOnClose);
                        dialog->show();
                    })
        ->setShortcut(QKeySequence("Ctrl+F1"));
    help->addSeparator();
    help->addAction(tr("&About FluoroCut"), this, [this] {
        auto* box = new QMessageBox(QMessageBox::NoIcon, tr("About FluoroCut"),
                                    tr("FluoroCut %1\n\nC-arm guided planning and robotic milling of the femoral "
                                       "cavity.\n\nResearch software, not a medical device.")
                                        .arg(QApplication::applicationVersion()),
                                    QMessageBox::Close, this);
        box->setAttribute(Qt::WA_DeleteOnClose);
        box->setModal(false);
        box->show();
    });
}

void MainWindow::chooseFiles() {
    auto* dialog = new QFileDialog(this, tr("Open images, CT, mesh or case"));
    dialog->setAttribute(Qt::WA_DeleteOnClose);
    dialog->setFileMode(QFileDialog::ExistingFiles);
    dialog->setNameFilters(
        {tr("All that can be opened (*.fluorocut *.png *.tif *.tiff *.dcm *.mha *.nrrd *.nii *.nii.gz "
            "*.stl *.obj *.ply)"),
         tr("All files (*)")});
    connect(dialog, &QFileDialog::filesSelected, this, &MainWindow::openFiles);
    dialog->open();
}

void MainWindow::chooseSaveAs() {
    auto* dialog = new QFileDialog(this, tr("Save case as"));
    dialog->setAttribute(Qt::WA_DeleteOnClose);
    dialog->setAcceptMode(QFileDialog::AcceptSave);
    dialog->setDefaultSuffix("fluorocut");
    dialog->setNameFilters({tr("Cases (*.fluorocut)")});
    connect(dialog, &QFileDialog::fileSelected, this,
            [this](const QString& file) { autosave_->saveAs(file.toStdString()); });
    dialog->open();
}

}  // namespace fluorocut::ui

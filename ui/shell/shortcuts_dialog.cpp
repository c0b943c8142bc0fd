#include "ui/shell/shortcuts_dialog.h"

#include <QAction>
#include <QHeaderView>
#include <QMainWindow>
#include <QMenu>
#include <QMenuBar>
#include <QTreeWidget>
#include <QVBoxLayout>

namespace fluorocut::ui {
namespace {

QString plain(QString text) {
    return text.remove('&').remove("...");
}

void collect(const QMenu& menu, const QString& where, std::vector<Shortcut>& shortcuts) {
    for (const QAction* action : menu.actions()) {
        if (action->menu() != nullptr)
            collect(*action->menu(), where, shortcuts);
        else if (!action->shortcut().isEmpty())
            shortcuts.push_back({where, plain(action->text()), action->shortcut().toString(QKeySequence::NativeText)});
    }
}

}  // namespace

std::vector<Shortcut> shortcutsOf(const QWidget& window) {
    std::vector<Shortcut> shortcuts;
    const auto* main = qobject_cast<const QMainWindow*>(&window);
    if (main == nullptr) return shortcuts;
    for (const QAction* top : main->menuBar()->actions())
        if (top->menu() != nullptr) collect(*top->menu(), plain(top->text()), shortcuts);
    return shortcuts;
}

std::vector<Shortcut> shortcutsInImages() {
    const QString where = ShortcutsDialog::tr("In an image");
    const auto row = [&where](const QString& what, const QString& keys) { return Shortcut{where, what, keys}; };
    return {row(ShortcutsDialog::tr("Window and level"), ShortcutsDialog::tr("Left drag")),
            row(ShortcutsDialog::tr("Pan"), ShortcutsDialog::tr("Middle drag")),
            row(ShortcutsDialog::tr("Zoom"), ShortcutsDialog::tr("Wheel, right drag")),
            row(ShortcutsDialog::tr("Show alone, and back"), ShortcutsDialog::tr("Double click")),
            row(ShortcutsDialog::tr("Point: its line in the other views"), ShortcutsDialog::tr("Shift and move")),
            row(ShortcutsDialog::tr("Fit"), "F"),
            row(ShortcutsDialog::tr("Automatic window"), "R"),
            row(ShortcutsDialog::tr("Windows for everything, bone, metal"), "1, 2, 3"),
            row(ShortcutsDialog::tr("Invert"), "I"),
            row(ShortcutsDialog::tr("Mirror"), "M")};
}

ShortcutsDialog::ShortcutsDialog(const std::vector<Shortcut>& shortcuts, QWidget* parent) : QDialog(parent) {
    setObjectName("shortcuts");
    setWindowTitle(tr("Shortcuts"));
    resize(560, 620);
    auto* tree = new QTreeWidget(this);
    tree->setColumnCount(2);
    tree->setHeaderLabels({tr("What"), tr("Keys")});
    tree->setRootIsDecorated(false);
    tree->setSelectionMode(QAbstractItemView::NoSelection);
    tree->setFrameShape(QFrame::NoFrame);
    tree->header()->setSectionResizeMode(0, QHeaderView::Stretch);
    tree->header()->setSectionResizeMode(1, QHeaderView::ResizeToContents);
    tree->header()->setStretchLastSection(false);
    QTreeWidgetItem* group = nullptr;
    for (const Shortcut& shortcut : shortcuts) {
        if (group == nullptr || group->text(0) != shortcut.where) {
            group = new QTreeWidgetItem(tree, {shortcut.where});
            QFont bold = font();
            bold.setBold(true);
            group->setFont(0, bold);
        }
        new QTreeWidgetItem(group, {shortcut.what, shortcut.keys});
    }
    tree->expandAll();
    auto* rows = new QVBoxLayout(this);
    rows->setContentsMargins(8, 8, 8, 8);
    rows->addWidget(tree);
}

}  // namespace fluorocut::ui

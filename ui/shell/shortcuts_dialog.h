// Every shortcut there is, made from the actions themselves, so that the list cannot be wrong; and what the mouse and
// single keys do in an image.
#pragma once

#include <QDialog>
#include <QString>
#include <vector>

class QAction;
class QTreeWidget;

namespace fluorocut::ui {

struct Shortcut {
    QString where, what, keys;
};

// Of every action of this window's menus that has one, in the menus' order.
std::vector<Shortcut> shortcutsOf(const QWidget& window);
// In image views: mouse and keys, which are no actions.
std::vector<Shortcut> shortcutsInImages();

class ShortcutsDialog : public QDialog {
    Q_OBJECT

  public:
    explicit ShortcutsDialog(const std::vector<Shortcut>& shortcuts, QWidget* parent = nullptr);
};

}  // namespace fluorocut::ui

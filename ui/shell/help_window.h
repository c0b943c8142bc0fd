// The user's manual, resources/help/*.md, in a window of its own beside the work. A widget says which page is about it
// by the property "helpPage" (of itself or of a widget around it); F1 shows the page of the place that has the focus.
#pragma once

#include <QDialog>
#include <QStringList>

class QListWidget;
class QTextBrowser;

namespace fluorocut::ui {

class HelpWindow : public QDialog {
    Q_OBJECT

  public:
    explicit HelpWindow(QWidget* parent = nullptr);

    // Names without .md, in the order in which they are read.
    static QStringList pages();
    // The page for a place on the screen; "start" where nobody says.
    static QString pageOf(const QWidget* place);

    void showPage(const QString& page);
    QString page() const { return page_; }
    QString text() const;

  private:
    QListWidget* list_;
    QTextBrowser* browser_;
    QString page_;
};

}  // namespace fluorocut::ui

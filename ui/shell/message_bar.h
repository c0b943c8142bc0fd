// A bar between menu and sheet that says what is going on or what went wrong, and blocks nothing: a job with its
// progress and a way to cancel it, or one sentence that stays until it is closed or something else is said.
#pragma once

#include <QFrame>

class QLabel;
class QProgressBar;
class QPushButton;

namespace fluorocut::ui {

class MessageBar : public QFrame {
    Q_OBJECT

  public:
    explicit MessageBar(QWidget* parent = nullptr);

    void showError(const QString& sentence);
    void showNote(const QString& sentence);
    void showProgress(const QString& what, double fraction, const QString& label);
    void clear();

    // Empty while nothing is said.
    QString sentence() const;
    bool isError() const { return kind_ == Kind::error; }

  signals:
    void cancelRequested();

  private:
    enum class Kind { nothing, note, error, progress };

    void show(Kind kind, const QString& text);

    Kind kind_ = Kind::nothing;
    QLabel* icon_;
    QLabel* text_;
    QProgressBar* progress_;
    QPushButton* button_;
};

}  // namespace fluorocut::ui

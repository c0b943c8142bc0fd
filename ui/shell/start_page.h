// What is seen before a case is open: the sample in one click, files, and the cases of the last days.
#pragma once

#include <QStringList>
#include <QWidget>

class QLabel;
class QPushButton;
class QVBoxLayout;

namespace fluorocut::ui {

class StartPage : public QWidget {
    Q_OBJECT

  public:
    explicit StartPage(QWidget* parent = nullptr);

    void setRecent(const QStringList& files);
    QPushButton* sampleButton() const { return sample_; }
    QPushButton* openButton() const { return open_; }
    const QList<QPushButton*>& recentButtons() const { return recent_; }

  signals:
    void sampleRequested();
    void openRequested();
    void recentRequested(const QString& file);

  private:
    QPushButton* sample_;
    QPushButton* open_;
    QLabel* recent_title_;
    QVBoxLayout* recent_list_;
    QList<QPushButton*> recent_;
};

}  // namespace fluorocut::ui

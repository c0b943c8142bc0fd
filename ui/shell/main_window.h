// The main window: lays out the image views and shows what a job is doing. It holds no algorithm: what is to be shown
// is made by a job that the program hands over.
#pragma once

#include <QMainWindow>
#include <QStringList>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/image.h"

class QGridLayout;
class QLabel;

namespace fluorocut::ui {

class ImageView;
class JobRunner;

struct TitledImage {
    QString title;
    std::shared_ptr<const Image> image;
};

using MakeImages = std::function<Result<std::vector<TitledImage>>(Progress&)>;

class MainWindow : public QMainWindow {
    Q_OBJECT

  public:
    explicit MainWindow(QWidget* parent = nullptr);

    // Starts the job; the views say `waiting` until it is done. `subject` (what is shown) stands in the title bar.
    // While a job runs, it is cancelled first and this one follows it.
    void show(const QString& subject, const QString& waiting, int expected_images, MakeImages make);
    using QMainWindow::show;

    const std::vector<ImageView*>& views() const { return views_; }

  signals:
    // The person chose image files in the menu.
    void openRequested(const QStringList& files);
    // The latest job is done: its images are shown, or its error's sentence is.
    void shown(bool ok, const QString& sentence);

  private:
    void makeMenus();
    void setViewCount(int count);
    void setMessages(const QString& message);
    void startNext();
    void finish(Result<std::vector<TitledImage>> images);

    JobRunner* jobs_;
    QGridLayout* grid_;
    QLabel* hint_;
    std::vector<ImageView*> views_;
    QString waiting_;
    MakeImages next_;
};

}  // namespace fluorocut::ui

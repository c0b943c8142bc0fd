// ImageView: one image of the spreadsheet, with the hand movements that every radiology workstation has.
//
//   left drag     window and level: right widens, down brightens
//   middle drag   pan (or left drag with Shift held)
//   wheel         zoom about the cursor
//   double click  fit to the view; R: the automatic window again
//
// Coordinates of the image have pixel centres at integers, as everywhere in FluoroCut.
#pragma once

#include <QWidget>
#include <memory>
#include <optional>

#include "core/image/image.h"
#include "ui/spreadsheet/gray_levels.h"

namespace fluorocut::ui {

class ImageView : public QWidget {
    Q_OBJECT

  public:
    explicit ImageView(QWidget* parent = nullptr);

    // Shows the image, fitted, in its automatic window. `title` stands in a corner.
    void setImage(std::shared_ptr<const Image> image, const QString& title);
    // What the view says while it has no image; progress in [0, 1] is shown as a thin bar.
    void setMessage(const QString& message, std::optional<double> progress = std::nullopt);

    const std::shared_ptr<const Image>& image() const { return image_; }
    DisplayWindow displayWindow() const { return window_; }
    void setDisplayWindow(const DisplayWindow& window);
    void resetDisplayWindow() { setDisplayWindow(levels_.fittingWindow()); }

    void fit();
    // Screen pixels for one image pixel.
    double zoom() const { return zoom_; }
    // Zooms so that what lies under `anchor` (in the widget) stays there.
    void zoomAbout(const QPointF& anchor, double factor);

    QPointF imageFromWidget(const QPointF& point) const;
    QPointF widgetFromImage(const QPointF& point) const;

    // What the read-out says of a place: coordinates and value; empty outside the image.
    QString readOut(const QPointF& point_in_widget) const;

    QSize sizeHint() const override { return {520, 520}; }
    QSize minimumSizeHint() const override { return {160, 160}; }

  signals:
    void displayWindowChanged();
    void viewChanged();

  protected:
    void paintEvent(QPaintEvent* event) override;
    void resizeEvent(QResizeEvent* event) override;
    void mousePressEvent(QMouseEvent* event) override;
    void mouseMoveEvent(QMouseEvent* event) override;
    void mouseReleaseEvent(QMouseEvent* event) override;
    void mouseDoubleClickEvent(QMouseEvent* event) override;
    void leaveEvent(QEvent* event) override;
    void wheelEvent(QWheelEvent* event) override;
    void keyPressEvent(QKeyEvent* event) override;

  private:
    enum class Drag { none, window, pan };

    double fittingZoom() const;
    void paintMessage(QPainter& painter) const;
    void paintCorners(QPainter& painter) const;

    std::shared_ptr<const Image> image_;
    GrayLevels levels_;
    DisplayWindow window_;
    QImage shown_;
    QString title_;
    QString message_;
    std::optional<double> progress_;

    double zoom_ = 1;
    QPointF corner_;      // where the image's upper left corner lies in the widget
    bool fitted_ = true;  // a resize keeps it so
    Drag drag_ = Drag::none;
    QPointF last_;
    std::optional<QPointF> cursor_;
};

}  // namespace fluorocut::ui

// ImageView: one image of the spreadsheet, with the hand movements that every radiology workstation has.
//
//   left drag     window and level: right widens, down brightens; a tool (view_tool.h) may take it first
//   middle drag   pan (or left drag with Shift held)
//   wheel         zoom about the cursor; so does a right drag: up is larger
//   double click  asks to be shown alone, or among the others again
//   F fit, R automatic window, I invert, M mirror; 1 2 3: the windows for everything, bone, metal
//
// Coordinates of the image have pixel centres at integers, as everywhere in FluoroCut. A mirrored view keeps them: only
// where they lie in the widget changes.
#pragma once

#include <QTransform>
#include <QWidget>
#include <memory>
#include <optional>

#include "core/image/image.h"
#include "ui/spreadsheet/gray_levels.h"
#include "ui/spreadsheet/overlay.h"
#include "ui/spreadsheet/view_marks.h"
#include "ui/spreadsheet/view_tool.h"

namespace fluorocut::ui {

enum class WindowPreset { everything, bone, metal };

class ImageView : public QWidget {
    Q_OBJECT

  public:
    explicit ImageView(QWidget* parent = nullptr);

    // Shows the image in its automatic window. `title` stands in a corner. An image of the size of the one before
    // keeps zoom, place and flip (the same view, in another column or state); any other is fitted.
    void setImage(std::shared_ptr<const Image> image, const QString& title);
    // The same picture, worked out anew: its window stays too.
    void replaceImage(std::shared_ptr<const Image> image);
    // What the view says while it has no image; progress in [0, 1] is shown as a thin bar.
    void setMessage(const QString& message, std::optional<double> progress = std::nullopt);
    void setMarks(const ViewMarks& marks);
    void setOverlay(Overlay overlay);
    const Overlay& overlay() const { return overlay_; }
    // What the hand is doing (a cursor's epipolar line): drawn last, and cheap to change.
    void setPassingOverlay(Overlay overlay);
    // Not owned; null: none.
    void setTool(ViewTool* tool) {
        tool_ = tool;
        update();
    }
    ViewTool* tool() const { return tool_; }

    const std::shared_ptr<const Image>& image() const { return image_; }
    const QString& title() const { return title_; }
    void setTitle(const QString& title);
    const QString& message() const { return message_; }
    DisplayWindow displayWindow() const { return window_; }
    void setDisplayWindow(const DisplayWindow& window);
    void setPreset(WindowPreset preset);
    void resetDisplayWindow() { setPreset(WindowPreset::everything); }
    bool isInverted() const { return inverted_; }
    void setInverted(bool inverted);
    bool isMirrored() const { return mirrored_; }
    void setMirrored(bool mirrored);

    void fit();
    bool isFitted() const { return fitted_; }
    // Screen pixels for one image pixel.
    double zoom() const { return zoom_; }
    // Zooms so that what lies under `anchor` (in the widget) stays there.
    void zoomAbout(const QPointF& anchor, double factor);
    // Where the widget's middle lies in the image, and the zoom relative to the fitting one: what linked views share.
    struct Glance {
        QPointF middle;
        double relative_zoom = 1;
    };
    Glance glance() const;
    void setGlance(const Glance& glance);

    QPointF imageFromWidget(const QPointF& point) const;
    QPointF widgetFromImage(const QPointF& point) const;
    QTransform widgetFromImage() const;

    // What the read-out says of a place: coordinates and value; empty outside the image.
    QString readOut(const QPointF& point_in_widget) const;

    QSize sizeHint() const override { return {520, 520}; }
    QSize minimumSizeHint() const override { return {160, 160}; }

  signals:
    void displayWindowChanged();
    void viewChanged();  // by hand: zoom or place
    void maximiseRequested();
    // The cursor with Shift held is at this pixel; nothing: it no longer is.
    void pointedAt(std::optional<QPointF> pixel);

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
    enum class Drag { none, window, pan, zoom, tool };

    double fittingZoom() const;
    void render();
    void showFitted();
    void paintMessage(QPainter& painter) const;
    void paintCorners(QPainter& painter) const;
    Touch touchAt(const QPointF& point, Qt::KeyboardModifiers modifiers) const;
    void stopPointing();

    std::shared_ptr<const Image> image_;
    GrayLevels levels_;
    DisplayWindow window_;
    QImage shown_;
    QString title_;
    QString message_;
    std::optional<double> progress_;
    ViewMarks marks_;
    Overlay overlay_, passing_;
    ViewTool* tool_ = nullptr;
    bool inverted_ = false, mirrored_ = false;

    double zoom_ = 1;
    QPointF corner_;      // where the image's upper left corner (upper right, mirrored) lies in the widget
    bool fitted_ = true;  // a resize keeps it so
    Drag drag_ = Drag::none;
    QPointF last_, pressed_;
    std::optional<QPointF> cursor_;
    bool pointing_ = false;
};

}  // namespace fluorocut::ui

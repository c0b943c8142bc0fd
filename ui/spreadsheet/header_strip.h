// The names along the sheet's upper or left side. A border between two sections is dragged to make one of them larger;
// a press on a section asks for its menu.
#pragma once

#include <QStringList>
#include <QWidget>
#include <vector>

namespace fluorocut::ui {

struct HeaderText {
    QString title;
    QStringList lines;     // below it, smaller
    bool warning = false;  // the lines say that something is amiss
    QString tip;

    friend bool operator==(const HeaderText&, const HeaderText&) = default;
};

class HeaderStrip : public QWidget {
    Q_OBJECT

  public:
    HeaderStrip(Qt::Orientation orientation, bool menus, QWidget* parent);

    void setTexts(std::vector<HeaderText> texts);
    // Where each section begins and ends in the widget, pixels along the strip.
    struct Span {
        int begin = 0, end = 0;
    };
    void setSpans(std::vector<Span> spans);
    const std::vector<Span>& spans() const { return spans_; }

  signals:
    // The border after section `index` was moved by so many pixels since the last time.
    void borderDragged(int index, int by);
    void menuRequested(int index, const QPoint& at);

  protected:
    void paintEvent(QPaintEvent* event) override;
    void mousePressEvent(QMouseEvent* event) override;
    void mouseMoveEvent(QMouseEvent* event) override;
    void mouseReleaseEvent(QMouseEvent* event) override;
    bool event(QEvent* event) override;

  private:
    int along(const QPoint& point) const { return orientation_ == Qt::Horizontal ? point.x() : point.y(); }
    int borderAt(int place) const;   // -1: none
    int sectionAt(int place) const;  // -1: none
    QRect areaOf(std::size_t index) const;

    Qt::Orientation orientation_;
    bool menus_;
    std::vector<HeaderText> texts_;
    std::vector<Span> spans_;
    int dragged_ = -1, last_ = 0;
};

}  // namespace fluorocut::ui

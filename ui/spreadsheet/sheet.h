// Sheet: the image spreadsheet. Rows are the case's views, columns pictures worked out of them (column.h); cells are
// ImageViews, worked out by a CellEngine.
//
//   double click, Enter   one cell alone, and back (Escape)
//   arrows, Tab           from cell to cell, unless the cell's tool takes them (nudges); with Alt always
//   Shift and move        epipolar lines in the other views, and the point in space once two views fix it: point in
//                         one, go over to another with Shift still held
//   drag a border between two headers   their sizes; a column's header has a menu: hide, move, change, remove, add
//
// Zoom and window follow each other along a row, along a column, or not (Link). Windows are shared only among pictures
// of the detector's levels, or only among differences.
//
// Columns, links and overlays are settings: save() and restore().
#pragma once

#include <QWidget>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "core/imaging/rays.h"
#include "ui/session/session.h"
#include "ui/spreadsheet/cell_engine.h"
#include "ui/spreadsheet/column.h"
#include "ui/spreadsheet/image_view.h"
#include "ui/spreadsheet/overlays.h"
#include "ui/spreadsheet/pointing.h"

class QMenu;
class QScrollArea;
class QSettings;
class QToolButton;

namespace fluorocut::ui {

class HeaderStrip;

class Sheet : public QWidget {
    Q_OBJECT

  public:
    enum class Link { none, row, column };

    // The session must outlive the sheet.
    explicit Sheet(Session& session, QWidget* parent = nullptr);
    ~Sheet() override;

    // ---- columns
    const std::vector<Column>& columns() const { return columns_; }
    void setColumns(std::vector<Column> columns);
    void addColumn(Column column);  // its id is made unlike the others'
    // What the arrow in a column's header opens; null for no such column. The caller owns it.
    QMenu* makeColumnMenu(const std::string& column);

    // ---- cells
    ImageView* cell(std::size_t view, const std::string& column) const;
    std::vector<ImageView*> cells() const;
    // What a cell shows: nothing for a view that is not one of the sheet's.
    std::optional<CellKey> keyOf(const ImageView& cell) const;
    std::optional<std::size_t> viewOf(const ImageView& cell) const;
    // How points in space come into the cell's pixels (a straightened picture has another imager than a raw one).
    std::optional<Picture> pictureOf(const ImageView& cell) const;
    // The cell with the keyboard, or that had it last.
    std::optional<CellKey> current() const { return current_; }
    void setCurrent(const CellKey& cell);

    void maximise(const CellKey& cell);
    void showAll();
    std::optional<CellKey> maximised() const { return maximised_; }

    // ---- tools: one for each cell that shows its view as it was taken before the cuts; pictures after a cut (whose
    // plan is fixed) and straightened ones have none. Null: none.
    using ToolFactory = std::function<std::unique_ptr<ViewTool>(std::size_t view)>;
    void setTools(ToolFactory factory);
    // Whether arrow keys are the tools' even when none takes them; those with Ctrl or Alt still go from cell to cell.
    void setArrowsAreTools(bool are) { arrows_are_tools_ = are; }
    // Something else to be drawn over a view's cells: handles, measures. Asked for at every refresh.
    using ExtraOverlay = std::function<Overlay(std::size_t view, const Picture&)>;
    void setExtraOverlay(ExtraOverlay extra);

    // ---- looks
    Link link() const { return link_; }
    void setLink(Link link);
    bool isShown(OverlayKind kind) const { return shown_.contains(kind); }
    // In all columns that have this kind.
    void setShown(OverlayKind kind, bool shown);
    // The handles, measures or silhouettes changed without the state.
    void refreshOverlays();
    // Of all cells.
    void fitAll();
    void resetWindows();

    void save(QSettings& settings) const;
    // A setting that cannot be read leaves the standard, and is told as a sentence.
    Result<void> restore(QSettings& settings);

    const CellEngine& engine() const { return engine_; }

  signals:
    void currentChanged(std::size_t view, const QString& column);
    void columnsChanged();
    // In femur, mm; nothing: none is pointed at.
    void pointedAt(std::optional<fluorocut::Vector3> point);

  protected:
    bool eventFilter(QObject* object, QEvent* event) override;
    void resizeEvent(QResizeEvent* event) override;
    void keyPressEvent(QKeyEvent* event) override;

  private:
    void equip(const CellKey& key);
    void makeToolbar();
    void updateToolbar();
    void fitToolbar();
    void refresh();
    void rebuildCells();
    void updateHeaders();
    void layOut();
    void layOutHeaders();
    void updateVisible();
    QString cellTitle(const CellKey& key) const;
    void showPicture(const CellKey& key);
    void showMarks(const CellKey& key);
    void connectCell(const CellKey& key, ImageView* cell);
    void windowChanged(const CellKey& from);
    void glanceChanged(const CellKey& from);
    bool linked(const CellKey& a, const CellKey& b) const;
    void adoptFromLinked(const CellKey& key);
    void pointAt(const CellKey& from, std::optional<QPointF> pixel);
    void showPointing();
    bool travel(int key);
    const Column* column(const std::string& id) const;
    std::vector<const Column*> visibleColumns() const;
    void fillColumnsMenu(QMenu& menu);
    void changeColumn(const std::string& id, const std::function<void(std::vector<Column>&, std::size_t)>& change);

    Session& session_;
    CellEngine engine_;
    Silhouettes silhouettes_;
    Session::State state_;
    std::vector<Column> columns_ = standardColumns();
    std::set<OverlayKind> shown_{kOverlayKinds.begin(), kOverlayKinds.end()};
    Link link_ = Link::row;
    Pointing pointing_;
    bool leaving_ = false;  // the cursor has just left a cell
    bool following_ = false;
    bool arrows_are_tools_ = false;
    ToolFactory tool_factory_;
    ExtraOverlay extra_;

    std::map<CellKey, ImageView*> cells_;
    std::map<CellKey, std::unique_ptr<ViewTool>> tools_;
    std::set<CellKey> on_screen_;
    std::optional<CellKey> current_, maximised_;
    std::vector<double> row_weights_, column_weights_;

    QWidget* toolbar_ = nullptr;
    QWidget* link_label_ = nullptr;
    int toolbar_room_ = 0;  // that its texts need
    std::map<OverlayKind, QToolButton*> overlay_buttons_;
    std::map<Link, QToolButton*> link_buttons_;
    QScrollArea* area_ = nullptr;
    QWidget* body_ = nullptr;
    HeaderStrip *row_header_ = nullptr, *column_header_ = nullptr;
};

}  // namespace fluorocut::ui

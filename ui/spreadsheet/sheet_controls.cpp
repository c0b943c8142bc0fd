// The sheet's controls: its row of switches, the columns' menus, and its settings.
#include <QAction>
#include <QButtonGroup>
#include <QHBoxLayout>
#include <QLabel>
#include <QMenu>
#include <QPainter>
#include <QSettings>
#include <QToolButton>
#include <algorithm>
#include <utility>

#include "ui/spreadsheet/column_dialog.h"
#include "ui/spreadsheet/sheet.h"

namespace fluorocut::ui {
namespace {

constexpr const char* kColumnsKey = "spreadsheet/columns";
constexpr const char* kLinkKey = "spreadsheet/link";
constexpr const char* kHiddenOverlaysKey = "spreadsheet/hidden-overlays";
constexpr const char* kLinks[] = {"none", "row", "column"};

// How the overlay's lines look.
QIcon swatch(Ink ink) {
    QPixmap picture(28, 16);
    picture.fill(Qt::transparent);
    QPainter painter(&picture);
    Overlay sample;
    sample.curves.push_back({ink, {{2, 8}, {26, 8}}, false, false});
    if (ink == Ink::bead) sample = {{}, {{ink, {14, 8}, MarkShape::ring, {}}}};
    paintOverlay(painter, sample, {});
    return picture;
}

QToolButton* makeSwitch(const QString& text, QWidget* parent) {
    auto* button = new QToolButton(parent);
    button->setText(text);
    button->setCheckable(true);
    button->setAutoRaise(true);
    button->setToolButtonStyle(Qt::ToolButtonTextBesideIcon);
    button->setFocusPolicy(Qt::TabFocus);
    return button;
}

}  // namespace

void Sheet::makeToolbar() {
    toolbar_ = new QWidget(this);
    auto* row = new QHBoxLayout(toolbar_);
    row->setContentsMargins(6, 3, 6, 3);
    row->setSpacing(2);
    for (const OverlayKind kind : kOverlayKinds) {
        QToolButton* button = makeSwitch(fluorocut::ui::titleOf(kind), toolbar_);
        button->setIcon(swatch(inkOf(kind)));
        button->setIconSize({28, 16});
        button->setObjectName(QStringLiteral("overlay-%1").arg(QString::fromLatin1(name(kind))));
        button->setToolTip(tr("%1: show or hide in all columns that have it").arg(fluorocut::ui::titleOf(kind)));
        connect(button, &QToolButton::clicked, this, [this, kind](bool on) { setShown(kind, on); });
        row->addWidget(button);
        overlay_buttons_[kind] = button;
    }
    row->addStretch(1);
    link_label_ = new QLabel(tr("Link zoom and window:"), toolbar_);
    row->addWidget(link_label_);
    for (const auto& [link, text] :
         {std::pair(Link::none, tr("none")), std::pair(Link::row, tr("row")), std::pair(Link::column, tr("column"))}) {
        QToolButton* button = makeSwitch(text, toolbar_);
        button->setToolTip(tr("Which cells zoom and window follow each other in"));
        button->setObjectName(QStringLiteral("link-%1").arg(QString::fromLatin1(kLinks[static_cast<int>(link)])));
        connect(button, &QToolButton::clicked, this, [this, chosen = link] { setLink(chosen); });
        row->addWidget(button);
        link_buttons_[link] = button;
    }
    auto* columns = makeSwitch(tr("Columns"), toolbar_);
    columns->setCheckable(false);
    columns->setObjectName(QStringLiteral("columns"));
    columns->setPopupMode(QToolButton::InstantPopup);
    auto* menu = new QMenu(columns);
    connect(menu, &QMenu::aboutToShow, this, [this, menu] { fillColumnsMenu(*menu); });
    columns->setMenu(menu);
    row->addWidget(columns);
    updateToolbar();
    toolbar_room_ = toolbar_->sizeHint().width();
    toolbar_->setMinimumWidth(1);  // it must not keep the window wide
}

// In a narrow sheet the switches show their lines without words.
void Sheet::fitToolbar() {
    const bool narrow = width() < toolbar_room_;
    for (const auto& [kind, button] : overlay_buttons_)
        button->setToolButtonStyle(narrow ? Qt::ToolButtonIconOnly : Qt::ToolButtonTextBesideIcon);
    link_label_->setVisible(!narrow);
}

void Sheet::updateToolbar() {
    for (const auto& [kind, button] : overlay_buttons_)
        button->setChecked(shown_.contains(kind));
    for (const auto& [link, button] : link_buttons_)
        button->setChecked(link == link_);
}

// ---- columns

void Sheet::setColumns(std::vector<Column> columns) {
    columns_ = std::move(columns);
    on_screen_.clear();
    engine_.setColumns(columns_);
    rebuildCells();
    emit columnsChanged();
}

void Sheet::addColumn(Column added) {
    std::vector<Column> columns = columns_;
    const std::string base = added.id.empty() ? added.kind : added.id;
    added.id = base;
    for (int n = 2; column(added.id); ++n)
        added.id = base + "-" + std::to_string(n);
    columns.push_back(std::move(added));
    setColumns(std::move(columns));
}

void Sheet::changeColumn(const std::string& id, const std::function<void(std::vector<Column>&, std::size_t)>& change) {
    std::vector<Column> columns = columns_;
    const auto at = std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.id == id; });
    if (at == columns.end()) return;
    change(columns, static_cast<std::size_t>(at - columns.begin()));
    if (columns != columns_) setColumns(std::move(columns));
}

QMenu* Sheet::makeColumnMenu(const std::string& id) {
    const Column* of = column(id);
    if (!of) return nullptr;
    auto* menu = new QMenu(this);
    const auto add = [&](const QString& text, const char* object, bool enabled,
                         std::function<void(std::vector<Column>&, std::size_t)> change) {
        QAction* action = menu->addAction(text);
        action->setObjectName(QString::fromLatin1(object));
        action->setEnabled(enabled);
        // Not at once: the menu belongs to what is about to be rebuilt.
        connect(
            action, &QAction::triggered, this, [this, id, change] { changeColumn(id, change); }, Qt::QueuedConnection);
    };
    const auto visible = visibleColumns();
    const bool is_only = visible.size() < 2;
    add(tr("Hide"), "hide", !is_only, [](auto& columns, std::size_t i) { columns[i].hidden = true; });
    // Past the next one that is seen.
    const auto move = [](int step) {
        return [step](std::vector<Column>& columns, std::size_t i) {
            for (int j = static_cast<int>(i) + step; j >= 0 && j < static_cast<int>(columns.size()); j += step) {
                const auto to = static_cast<std::size_t>(j);
                std::swap(columns[static_cast<std::size_t>(j - step)], columns[to]);
                if (!columns[static_cast<std::size_t>(j - step)].hidden) break;
            }
        };
    };
    add(tr("Move left"), "left", !visible.empty() && visible.front() != of, move(-1));
    add(tr("Move right"), "right", !visible.empty() && visible.back() != of, move(1));
    menu->addSeparator();
    QAction* edit = menu->addAction(tr("Change..."));
    edit->setObjectName(QStringLiteral("change"));
    connect(
        edit, &QAction::triggered, this,
        [this, id] {
            const Column* now = column(id);
            if (!now) return;
            editColumn(*now, tr("Change column"), this, [this, id](const Column& changed) {
                changeColumn(id, [&](auto& columns, std::size_t i) { columns[i] = changed; });
            });
        },
        Qt::QueuedConnection);
    add(tr("Remove"), "remove", !is_only,
        [](auto& columns, std::size_t i) { columns.erase(columns.begin() + static_cast<std::ptrdiff_t>(i)); });
    menu->addSeparator();
    fillColumnsMenu(*menu->addMenu(tr("Columns")));
    return menu;
}

void Sheet::fillColumnsMenu(QMenu& menu) {
    menu.clear();
    for (const Column& each : columns_) {
        QAction* action = menu.addAction(fluorocut::ui::titleOf(each));
        action->setCheckable(true);
        action->setChecked(!each.hidden);
        action->setEnabled(each.hidden || visibleColumns().size() > 1);
        action->setObjectName(QStringLiteral("show-%1").arg(QString::fromStdString(each.id)));
        connect(
            action, &QAction::triggered, this,
            [this, id = each.id](bool shown) {
                changeColumn(id, [&](auto& columns, std::size_t i) { columns[i].hidden = !shown; });
            },
            Qt::QueuedConnection);
    }
    menu.addSeparator();
    connect(
        menu.addAction(tr("Add a column...")), &QAction::triggered, this,
        [this] {
            editColumn(columnsToChooseFrom().front(), tr("Add a column"), this,
                       [this](const Column& added) { addColumn(added); });
        },
        Qt::QueuedConnection);
    connect(
        menu.addAction(tr("Standard columns")), &QAction::triggered, this, [this] { setColumns(standardColumns()); },
        Qt::QueuedConnection);
}

// ---- settings

void Sheet::save(QSettings& settings) const {
    settings.setValue(kColumnsKey, QString::fromUtf8(jsonOf(columns_)));
    settings.setValue(kLinkKey, QString::fromLatin1(kLinks[static_cast<int>(link_)]));
    QStringList hidden;
    for (const OverlayKind kind : kOverlayKinds)
        if (!shown_.contains(kind)) hidden << QString::fromLatin1(name(kind));
    settings.setValue(kHiddenOverlaysKey, hidden);
}

Result<void> Sheet::restore(QSettings& settings) {
    const QString link = settings.value(kLinkKey).toString();
    for (int i = 0; i < 3; ++i)
        if (link == kLinks[i]) link_ = static_cast<Link>(i);
    const QStringList hidden = settings.value(kHiddenOverlaysKey).toStringList();
    shown_ = {kOverlayKinds.begin(), kOverlayKinds.end()};
    for (const OverlayKind kind : kOverlayKinds)
        if (hidden.contains(QString::fromLatin1(name(kind)))) shown_.erase(kind);
    updateToolbar();
    Result<void> read;
    if (settings.contains(kColumnsKey)) {
        auto columns = columnsFromJson(settings.value(kColumnsKey).toString().toUtf8());
        if (columns)
            setColumns(std::move(*columns));
        else
            read = columns.error();
    }
    refreshOverlays();
    return read;
}

}  // namespace fluorocut::ui

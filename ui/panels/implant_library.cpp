#include "ui/panels/implant_library.h"

#include <QGridLayout>
#include <QHeaderView>
#include <QLabel>
#include <QListWidget>
#include <QPushButton>
#include <QTableWidget>

#include "core/io/resources.h"
#include "core/planning/implant_file.h"

namespace fluorocut::ui {

ImplantShelf ImplantShelf::read() {
    ImplantShelf shelf;
    for (const std::string& name : resourceNames("implants")) {
        const auto path = findResource("implants", name);
        Result<ImplantFamily> family = path ? readImplantFamily(*path) : Result<ImplantFamily>(path.error());
        if (family)
            shelf.entries.push_back({name, std::move(*family)});
        else
            shelf.problems += QString::fromStdString(family.error().message()) + "\n";
    }
    return shelf;
}

const ImplantFamily* ImplantShelf::family(const std::string& name) const {
    for (const Entry& entry : entries)
        if (entry.name == name) return &entry.family;
    return nullptr;
}

ImplantLibrary::ImplantLibrary(const ImplantShelf& shelf, QWidget* parent) : QWidget(parent), shelf_(shelf) {
    auto* grid = new QGridLayout(this);
    families_ = new QListWidget(this);
    families_->setObjectName("families");
    for (const ImplantShelf::Entry& entry : shelf_.entries)
        families_->addItem(QString::fromStdString(entry.name));
    families_->setMaximumWidth(fontMetrics().averageCharWidth() * 22);
    about_ = new QLabel(this);
    about_->setWordWrap(true);
    about_->setAlignment(Qt::AlignTop);
    sizes_ = new QTableWidget(this);
    sizes_->setObjectName("sizes");
    sizes_->setColumnCount(5);
    sizes_->setHorizontalHeaderLabels(
        {tr("Size"), tr("Length, mm"), tr("Tip, mm"), tr("Resection, mm"), tr("Offset, mm")});
    sizes_->setEditTriggers(QAbstractItemView::NoEditTriggers);
    sizes_->setSelectionBehavior(QAbstractItemView::SelectRows);
    sizes_->setSelectionMode(QAbstractItemView::SingleSelection);
    sizes_->verticalHeader()->hide();
    sizes_->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
    sizes_->horizontalHeader()->setStretchLastSection(true);
    use_ = new QPushButton(tr("Use this implant"), this);
    use_->setObjectName("use");
    auto* problems = new QLabel(shelf_.problems, this);
    problems->setWordWrap(true);
    problems->setVisible(!shelf_.problems.isEmpty());
    grid->addWidget(families_, 0, 0, 2, 1);
    grid->addWidget(about_, 0, 1);
    grid->addWidget(sizes_, 1, 1);
    grid->addWidget(problems, 2, 0, 1, 2);
    grid->addWidget(use_, 3, 1, Qt::AlignRight);
    grid->setRowStretch(1, 1);
    grid->setColumnStretch(1, 1);
    connect(families_, &QListWidget::currentRowChanged, this, &ImplantLibrary::showFamily);
    connect(sizes_, &QTableWidget::cellDoubleClicked, this, &ImplantLibrary::take);
    connect(sizes_, &QTableWidget::itemSelectionChanged, this, [this] { use_->setEnabled(sizes_->currentRow() >= 0); });
    connect(use_, &QPushButton::clicked, this, &ImplantLibrary::take);
    families_->setCurrentRow(0);
    use_->setEnabled(sizes_->currentRow() >= 0);
}

void ImplantLibrary::showFamily() {
    const int row = families_->currentRow();
    if (row < 0) return;
    const ImplantFamily& family = shelf_.entries[static_cast<std::size_t>(row)].family;
    about_->setText(QString::fromStdString(family.description));
    about_->setToolTip(QString::fromStdString(family.basis));
    sizes_->setRowCount(static_cast<int>(family.sizes.size()));
    for (int i = 0; i < sizes_->rowCount(); ++i) {
        const StemSize& size = family.sizes[static_cast<std::size_t>(i)];
        const auto number = [](double value) { return QString::number(value, 'f', 1); };
        const auto pair = [&](const Vector2& v) { return number(v.x()) + QStringLiteral(" \u00d7 ") + number(v.y()); };
        const QStringList texts{QString::fromStdString(size.name), number(size.length_mm), pair(size.distal_mm),
                                pair(size.proximal_mm), number(size.offset_mm)};
        for (int column = 0; column < texts.size(); ++column)
            sizes_->setItem(i, column, new QTableWidgetItem(texts[column]));
    }
    sizes_->setCurrentCell(sizes_->rowCount() / 2, 0);
}

void ImplantLibrary::choose(const std::string& family, const std::string& size) {
    for (std::size_t f = 0; f < shelf_.entries.size(); ++f) {
        if (shelf_.entries[f].name != family) continue;
        families_->setCurrentRow(static_cast<int>(f));
        for (std::size_t s = 0; s < shelf_.entries[f].family.sizes.size(); ++s)
            if (shelf_.entries[f].family.sizes[s].name == size) sizes_->setCurrentCell(static_cast<int>(s), 0);
    }
}

void ImplantLibrary::take() {
    const int family = families_->currentRow(), size = sizes_->currentRow();
    if (family < 0 || size < 0) return;
    const ImplantShelf::Entry& entry = shelf_.entries[static_cast<std::size_t>(family)];
    emit chosen(QString::fromStdString(entry.name),
                QString::fromStdString(entry.family.sizes[static_cast<std::size_t>(size)].name));
}

}  // namespace fluorocut::ui

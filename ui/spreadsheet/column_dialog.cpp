#include "ui/spreadsheet/column_dialog.h"

#include <QCheckBox>
#include <QComboBox>
#include <QDialogButtonBox>
#include <QFormLayout>
#include <QGroupBox>
#include <QLabel>
#include <QLineEdit>
#include <QSpinBox>
#include <QVBoxLayout>
#include <algorithm>
#include <utility>

namespace fluorocut::ui {

ColumnDialog::ColumnDialog(Column column, QWidget* parent) : QDialog(parent), column_(std::move(column)) {
    auto* rows = new QVBoxLayout(this);
    auto* form = new QFormLayout;
    rows->addLayout(form);
    kind_ = new QComboBox(this);
    kind_->setObjectName(QStringLiteral("kind"));
    for (const Column& kind : columnsToChooseFrom()) {
        Column plain = kind;
        plain.against = Against::before;
        kind_->addItem(titleOf(plain), QString::fromStdString(kind.kind));
    }
    form->addRow(tr("Picture"), kind_);
    cut_ = new QSpinBox(this);
    cut_->setObjectName(QStringLiteral("cut"));
    cut_->setRange(0, 1000);
    cut_->setSpecialValueText(tr("the latest"));
    cut_->setValue(column_.cut);
    cut_label_ = new QLabel(tr("Cut"), this);
    form->addRow(cut_label_, cut_);
    against_ = new QComboBox(this);
    against_->setObjectName(QStringLiteral("against"));
    against_->addItems({tr("before"), tr("prediction")});
    against_->setCurrentIndex(static_cast<int>(column_.against));
    against_label_ = new QLabel(tr("Compared with"), this);
    form->addRow(against_label_, against_);
    title_ = new QLineEdit(column_.title, this);
    title_->setObjectName(QStringLiteral("title"));
    form->addRow(tr("Title"), title_);

    auto* group = new QGroupBox(tr("Overlays"), this);
    auto* boxes = new QVBoxLayout(group);
    for (const OverlayKind kind : kOverlayKinds) {
        auto* box = new QCheckBox(titleOf(kind), group);
        box->setObjectName(QStringLiteral("overlay-%1").arg(QString::fromLatin1(name(kind))));
        box->setChecked(column_.overlays.contains(kind));
        boxes->addWidget(box);
        overlays_[kind] = box;
    }
    rows->addWidget(group);
    auto* buttons = new QDialogButtonBox(QDialogButtonBox::Ok | QDialogButtonBox::Cancel, this);
    connect(buttons, &QDialogButtonBox::accepted, this, &QDialog::accept);
    connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::reject);
    rows->addWidget(buttons);

    kind_->setCurrentIndex(kind_->findData(QString::fromStdString(column_.kind)));
    connect(kind_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ColumnDialog::choose);
    showFields();
}

void ColumnDialog::choose(int kind) {
    const Column fresh = columnsToChooseFrom().at(static_cast<std::size_t>(kind));
    for (const auto& [overlay, box] : overlays_)
        box->setChecked(fresh.overlays.contains(overlay));
    showFields();
}

void ColumnDialog::showFields() {
    const Column now = column();
    cut_->setVisible(hasCut(now));
    cut_label_->setVisible(hasCut(now));
    against_->setVisible(now.kind == "difference");
    against_label_->setVisible(now.kind == "difference");
    Column untitled = now;
    untitled.title.clear();
    title_->setPlaceholderText(titleOf(untitled));
}

Column ColumnDialog::column() const {
    Column chosen = column_;
    chosen.kind = kind_->currentData().toString().toStdString();
    if (chosen.kind != column_.kind && column_.id == column_.kind) chosen.id = chosen.kind;
    chosen.cut = hasCut(chosen) ? cut_->value() : 0;
    chosen.against = static_cast<Against>(std::max(0, against_->currentIndex()));
    chosen.title = title_->text();
    chosen.overlays.clear();
    for (const auto& [kind, box] : overlays_)
        if (box->isChecked()) chosen.overlays.insert(kind);
    return chosen;
}

void editColumn(const Column& column, const QString& title, QWidget* parent,
                std::function<void(const Column&)> accept) {
    auto* dialog = new ColumnDialog(column, parent);
    dialog->setAttribute(Qt::WA_DeleteOnClose);
    dialog->setWindowTitle(title);
    QObject::connect(dialog, &QDialog::accepted, parent,
                     [dialog, accept = std::move(accept)] { accept(dialog->column()); });
    dialog->open();
}

}  // namespace fluorocut::ui

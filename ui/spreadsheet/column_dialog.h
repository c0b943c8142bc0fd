// Asks what a column of the spreadsheet should be: its kind, cut, what it is compared with, overlays and title.
#pragma once

#include <QDialog>
#include <functional>
#include <map>

#include "ui/spreadsheet/column.h"

class QCheckBox;
class QComboBox;
class QLabel;
class QLineEdit;
class QSpinBox;

namespace fluorocut::ui {

class ColumnDialog : public QDialog {
    Q_OBJECT

  public:
    explicit ColumnDialog(Column column, QWidget* parent = nullptr);

    Column column() const;

  private:
    void choose(int kind);
    void showFields();

    Column column_;
    QComboBox *kind_, *against_;
    QSpinBox* cut_;
    QLineEdit* title_;
    QLabel *cut_label_, *against_label_;
    std::map<OverlayKind, QCheckBox*> overlays_;
};

// Shows the dialog without waiting for it; `accept` gets what was chosen.
void editColumn(const Column& column, const QString& title, QWidget* parent, std::function<void(const Column&)> accept);

}  // namespace fluorocut::ui

// The settings, each put into effect and kept as soon as it is changed.
#pragma once

#include <QDialog>

class QComboBox;
class QLineEdit;

namespace fluorocut::ui {

class Settings;

class SettingsDialog : public QDialog {
    Q_OBJECT

  public:
    explicit SettingsDialog(Settings& settings, QWidget* parent = nullptr);

    QComboBox* look() const { return look_; }
    QComboBox* language() const { return language_; }
    QLineEdit* folder() const { return folder_; }

  private:
    QComboBox* look_;
    QComboBox* language_;
    QLineEdit* folder_;
};

}  // namespace fluorocut::ui

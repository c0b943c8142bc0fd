#include "ui/shell/settings_dialog.h"

#include <QComboBox>
#include <QDialogButtonBox>
#include <QFileDialog>
#include <QFormLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QVBoxLayout>

#include "ui/shell/settings.h"

namespace fluorocut::ui {

SettingsDialog::SettingsDialog(Settings& settings, QWidget* parent)
    : QDialog(parent), look_(new QComboBox(this)), language_(new QComboBox(this)), folder_(new QLineEdit(this)) {
    setObjectName("settings");
    setWindowTitle(tr("Settings"));
    setMinimumWidth(480);
    setProperty("helpPage", "files");

    look_->addItems({tr("Dark"), tr("Light"), tr("Operating room (large)")});
    look_->setCurrentIndex(static_cast<int>(settings.look()));
    connect(look_, QOverload<int>::of(&QComboBox::currentIndexChanged), &settings,
            [&settings](int index) { settings.setLook(static_cast<Look>(index)); });

    // Each language by its own name, in every language.
    language_->addItem(tr("As the system"), QString());
    language_->addItem("English", "en");
    language_->addItem("Deutsch", "de");
    language_->setCurrentIndex(std::max(0, language_->findData(settings.language())));
    connect(language_, QOverload<int>::of(&QComboBox::currentIndexChanged), &settings,
            [this, &settings] { settings.setLanguage(language_->currentData().toString()); });
    auto* later = new QLabel(tr("The language changes at the next start."), this);
    later->setWordWrap(true);
    later->setForegroundRole(QPalette::PlaceholderText);

    folder_->setText(settings.caseFolder());
    connect(folder_, &QLineEdit::editingFinished, &settings,
            [this, &settings] { settings.setCaseFolder(folder_->text()); });
    auto* browse = new QPushButton(tr("Choose..."), this);
    connect(browse, &QPushButton::clicked, this, [this, &settings] {
        const QString folder = QFileDialog::getExistingDirectory(this, tr("Folder for cases"), folder_->text());
        if (folder.isEmpty()) return;
        folder_->setText(folder);
        settings.setCaseFolder(folder);
    });
    auto* folder_row = new QHBoxLayout;
    folder_row->addWidget(folder_, 1);
    folder_row->addWidget(browse);
    auto* what =
        new QLabel(tr("Every edit of a case that has no file yet is saved there, from the next case on."), this);
    what->setWordWrap(true);
    what->setForegroundRole(QPalette::PlaceholderText);

    auto* form = new QFormLayout;
    form->addRow(tr("Look"), look_);
    form->addRow(tr("Language"), language_);
    form->addRow(QString(), later);
    form->addRow(tr("Folder for cases"), folder_row);
    form->addRow(QString(), what);
    auto* buttons = new QDialogButtonBox(this);
    connect(buttons->addButton(tr("Close"), QDialogButtonBox::RejectRole), &QPushButton::clicked, this,
            &QDialog::close);
    auto* rows = new QVBoxLayout(this);
    rows->addLayout(form);
    rows->addStretch(1);
    rows->addWidget(buttons);
}

}  // namespace fluorocut::ui

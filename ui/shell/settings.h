// What the desktop remembers from one start to the next, in a file of its own (INI), which tests put where they like.
#pragma once

#include <QObject>
#include <QSettings>
#include <QString>
#include <QStringList>

#include "ui/shell/theme.h"

namespace fluorocut::ui {

class Settings : public QObject {
    Q_OBJECT

  public:
    static constexpr int kMostRecent = 10;

    explicit Settings(const QString& file, QObject* parent = nullptr);
    // In the user's configuration folder.
    static QString usualFile();

    // A value that the file has wrong counts as absent.
    Look look() const;
    void setLook(Look look);
    // "en", "de", or empty: the system's. It is used at the next start.
    QString language() const;
    void setLanguage(const QString& language);
    // Where cases are saved that have no file yet.
    QString caseFolder() const;
    void setCaseFolder(const QString& folder);

    // Newest first; those that are gone are left out.
    QStringList recentFiles() const;
    void addRecent(const QString& file);
    void clearRecent();

    QByteArray layout(const QString& of) const { return store_.value("layout/" + of).toByteArray(); }
    void setLayout(const QString& of, const QByteArray& state) { store_.setValue("layout/" + of, state); }

    // For those who keep settings of their own: the sheet.
    QSettings& store() { return store_; }

  signals:
    void lookChanged(fluorocut::ui::Look look);
    void recentChanged();

  private:
    QSettings store_;
};

}  // namespace fluorocut::ui

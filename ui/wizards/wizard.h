// Wizard: leads through its pages (wizard_page.h), one after the other. Next is locked until the page's measurement is
// met; a person may override it with a name and a reason. Back loses nothing. What a page was left forward by (its
// numbers met, or a person) is handed to the keeper, and the way goes on only once it is kept.
//
//     Wizard wizard(tr("Calibrate the imager"));
//     wizard.addPage(new PlatePage(...));
//     wizard.setKeeper([](const WizardDecision& decision, auto kept) { ...; kept({}); });
//
// Keys: Enter presses the button that has the focus, or else does what is next: the page's first action, or Next once
// it is free. Alt+Left and Alt+Right go back and on; Escape leaves the override alone, never the wizard.
#pragma once

#include <QWidget>
#include <functional>
#include <vector>

#include "core/base/result.h"
#include "ui/wizards/wizard_page.h"

class QFrame;
class QLabel;
class QLineEdit;
class QPushButton;
class QStackedWidget;

namespace fluorocut::ui {

class Navigator;

// With what a page was left.
struct WizardDecision {
    QString page, title;
    Acceptance acceptance;
    bool by_limits = true;  // all met; false: `who` overrode them
    QString who, why;
};

// Calls `kept` once, on the same thread, now or later: an error keeps the wizard where it is and is shown.
using KeepDecision = std::function<void(const WizardDecision&, std::function<void(Result<void>)> kept)>;

class Wizard : public QWidget {
    Q_OBJECT

  public:
    explicit Wizard(const QString& title, QWidget* parent = nullptr);

    const QString& title() const { return title_; }
    // Owned from then on. The first one is shown.
    void addPage(WizardPage* page);
    void setKeeper(KeepDecision keeper) { keeper_ = std::move(keeper); }

    int index() const { return index_; }
    int pageCount() const { return static_cast<int>(pages_.size()); }
    WizardPage& page(int index) const { return *pages_.at(static_cast<std::size_t>(index)); }
    WizardPage& current() const { return page(index_); }

    // What the buttons do; nothing when they are locked.
    void next();
    void back();

    QPushButton* nextButton() const { return next_; }
    QPushButton* backButton() const { return back_; }
    QPushButton* closeButton() const { return close_; }
    QPushButton* overrideButton() const { return override_; }
    // The override's own part, shown while it is asked for.
    QLineEdit* nameField() const { return name_; }
    QLineEdit* reasonField() const { return reason_; }
    QPushButton* confirmOverride() const { return confirm_; }

  signals:
    void pageChanged(int index);
    void finished();        // from the last page, forward
    void closeRequested();  // before that; the pages stay as they are

  protected:
    void resizeEvent(QResizeEvent* event) override;

  private:
    QFrame* makeOverride();
    void enter();
    void goTo(int index);
    void follow();
    void askOverride(bool ask);
    bool mayReach(int index) const;

    QString title_;
    std::vector<WizardPage*> pages_;
    std::vector<bool> kept_;  // the page's present state is
    KeepDecision keeper_;
    int index_ = 0;
    bool keeping_ = false;

    Navigator* steps_;
    QLabel *heading_, *why_locked_;
    QStackedWidget* stack_;
    QPushButton *close_, *back_, *next_, *override_, *confirm_;
    QFrame* override_panel_;
    QLineEdit *name_, *reason_;
};

}  // namespace fluorocut::ui

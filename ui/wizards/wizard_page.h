// WizardPage: one thing to be done before the next: one instruction, one picture, what the picture is worth as it comes
// in (its quality), and what has been measured against what limits (the acceptance). A Wizard (wizard.h) leads from
// page to page.
//
//     setWorking(tr("Looking for grooves"), 0.4);        // meanwhile
//     setQuality({...});                                 // of the newest picture
//     setAcceptance(judge(map));                         // Next is free when all of it is met
//     setProblem(tr("No plate in the picture."));        // nothing could be measured: why, and what to do
//
// A page with a measurement that misses its limits may be overridden by a person with a name and a reason. A page whose
// measurement was redone makes those behind it stale (redone()). Nothing is forgotten by leaving a page.
//
// To write a new page: one file pair, derive, give it actions (addAction; the first one is what Enter does), call the
// above from what they start. Long work goes through a JobRunner.
#pragma once

#include <QWidget>
#include <functional>
#include <optional>
#include <vector>

#include "ui/spreadsheet/image_view.h"
#include "ui/wizards/check_list.h"

class QLabel;
class QProgressBar;
class QPushButton;
class QVBoxLayout;

namespace fluorocut::ui {

class Section;

class WizardPage : public QWidget {
    Q_OBJECT

  public:
    // `id` names the page in files: "plate".
    WizardPage(const QString& id, const QString& title, const QString& instruction, QWidget* parent = nullptr);

    const QString& id() const { return id_; }
    const QString& title() const { return title_; }
    QString instruction() const;
    void setInstruction(const QString& instruction);

    // The picture; another widget takes its place and is owned from then on.
    ImageView& view() { return *view_; }
    void setPicture(QWidget* widget);
    // For what a page shows besides, between its actions and the quality.
    QVBoxLayout* body() const { return body_; }

    QPushButton* addAction(const QString& text, std::function<void()> what);
    // The first enabled action; null: none.
    QPushButton* primaryAction() const;

    void setQuality(std::vector<CheckRow> rows);
    const std::vector<CheckRow>& quality() const;
    // A new measurement; whatever was overridden or stale is so no longer. `advice`: what would make it better.
    void setAcceptance(Acceptance acceptance, const QString& advice = {});
    void setProblem(const QString& sentence);
    // Nothing is measured here: a page that explains, or sums up.
    void setNothingToMeasure();
    void setAdvice(const QString& advice);

    // While something runs the page is not left forward. Fractions in [0, 1].
    void setWorking(const QString& what, double fraction = 0);
    void setIdle();
    bool isWorking() const { return working_; }

    const Acceptance& acceptance() const { return acceptance_; }
    bool isMet() const;
    Light light() const;
    // Why Next is locked, in a sentence; empty when it is not.
    QString reason() const;

    // What it rests on was redone: it has to be measured again.
    void setStale(const QString& because);
    bool isStale() const { return !stale_.isEmpty(); }

    struct Override {
        QString who, why;
    };
    bool mayBeOverridden() const;
    // Broken contract (std::logic_error): not mayBeOverridden(), a blank name or reason.
    void overrideLimits(Override by);
    const std::optional<Override>& overriddenBy() const { return override_; }
    bool mayGoOn() const { return !working_ && (isMet() || override_.has_value()); }

    // It comes to the front, from either side.
    virtual void entered() {}

  signals:
    void changed();  // anything of the above
    void redone();   // there is another measurement, or none any more

  private:
    void showAcceptance();

    QString id_, title_;
    QLabel *instruction_, *advice_, *work_, *override_note_;
    QWidget* picture_;
    ImageView* view_;
    QVBoxLayout *picture_box_, *body_, *actions_;
    std::vector<QPushButton*> buttons_;
    QProgressBar* progress_;
    Section *quality_section_, *acceptance_section_;
    CheckList *quality_list_, *acceptance_list_;

    Acceptance acceptance_;
    QString problem_, stale_;
    bool nothing_to_measure_ = false, working_ = false;
    std::optional<Override> override_;
};

}  // namespace fluorocut::ui

// The parts of the plan inspector. Each shows what session.state() says when it is refreshed, and edits through the
// session; none of them remembers anything of the plan.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "ui/panels/implant_library.h"
#include "ui/panels/measure_tool.h"
#include "ui/panels/number_field.h"
#include "ui/panels/plan_jobs.h"
#include "ui/panels/section.h"

class QButtonGroup;
class QCheckBox;
class QComboBox;
class QGridLayout;
class QProgressBar;
class QPushButton;
class QToolButton;

namespace fluorocut::ui {

// Family, size, head and neck; smaller and larger; the lock; planning automatically.
class ImplantSection final : public Section {
    Q_OBJECT

  public:
    ImplantSection(Session& session, PlanJobs& jobs, QWidget* parent = nullptr);
    void refresh();
    KeptPoint keptPoint() const;

  signals:
    void keptPointChanged();

  private:
    void use(const std::string& family, const std::string& size);
    void step(int steps);
    void changeHead();
    void showLibrary();

    Session& session_;
    PlanJobs& jobs_;
    ImplantShelf shelf_;
    QComboBox *family_, *size_, *head_, *neck_, *kept_;
    QToolButton *smaller_, *larger_;
    QPushButton *library_, *automatic_;
    QCheckBox* lock_;
};

// The pose in a surgeon's numbers (core/planning/stem_numbers.h).
class PoseSection final : public Section {
    Q_OBJECT

  public:
    PoseSection(Session& session, PlanStudy& study, QWidget* parent = nullptr);
    void refresh();

  private:
    void edit(std::size_t field, double value);
    void snap();
    void takeCanal();

    Session& session_;
    PlanStudy& study_;
    std::vector<NumberField*> fields_;
    QPushButton *snap_, *canal_;
};

// What is measured: by the plan, and by hand.
class MeasuresSection final : public Section {
    Q_OBJECT

  public:
    MeasuresSection(Session& session, PlanStudy& study, MeasureChoice& choice, QWidget* parent = nullptr);
    ~MeasuresSection() override;
    void refresh();

  private:
    struct Row;
    void remove(std::size_t placed);

    Session& session_;
    PlanStudy& study_;
    MeasureChoice& choice_;
    QButtonGroup* tools_;
    QGridLayout* rows_;
    std::vector<std::unique_ptr<Row>> shown_;
};

// How the stem fills the canal, and the wall that it leaves.
class FillSection final : public Section {
    Q_OBJECT

  public:
    FillSection(PlanStudy& study, QWidget* parent = nullptr);
    void refresh();

  private:
    PlanStudy& study_;
    QLabel *table_, *wall_;
};

// The cavities to be cut one after the other.
class StagesSection final : public Section {
    Q_OBJECT

  public:
    StagesSection(Session& session, PlanJobs& jobs, QWidget* parent = nullptr);
    void refresh();

  private:
    void edit(const std::vector<double>& insets_mm, double cutter_radius_mm);

    Session& session_;
    PlanJobs& jobs_;
    NumberField *count_, *cutter_;
    std::vector<NumberField*> insets_;
    QVBoxLayout* inset_rows_;
    QPushButton* cavities_;
};

}  // namespace fluorocut::ui

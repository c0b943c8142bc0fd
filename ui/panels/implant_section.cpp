#include <QCheckBox>
#include <QComboBox>
#include <QDialog>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QSignalBlocker>
#include <QToolButton>
#include <QVBoxLayout>
#include <algorithm>

#include "core/planning/implant_file.h"
#include "ui/panels/plan_sections.h"

namespace fluorocut::ui {
namespace {

void fill(QComboBox& box, const QStringList& texts, int current) {
    const QSignalBlocker quiet(box);
    QStringList present;
    for (int i = 0; i < box.count(); ++i)
        present << box.itemText(i);
    if (present != texts) {
        box.clear();
        box.addItems(texts);
    }
    box.setCurrentIndex(current);
}

QStringList listed(const std::vector<double>& values, bool sign) {
    QStringList texts;
    for (const double value : values)
        texts << (sign && value > 0 ? QStringLiteral("+") : QString()) + QString::number(value) + " mm";
    return texts;
}

int indexOf(const std::vector<double>& values, double value) {
    const auto found = std::find(values.begin(), values.end(), value);
    return found == values.end() ? -1 : static_cast<int>(found - values.begin());
}

}  // namespace

ImplantSection::ImplantSection(Session& session, PlanJobs& jobs, QWidget* parent)
    : Section(tr("Implant"), parent), session_(session), jobs_(jobs), shelf_(ImplantShelf::read()) {
    auto* grid = new QGridLayout;
    int row = 0;
    const auto combo = [&](const QString& name, const char* object) {
        auto* box = new QComboBox(this);
        box->setObjectName(object);
        box->setAccessibleName(name);
        box->setSizeAdjustPolicy(QComboBox::AdjustToContents);
        auto* label = new QLabel(name, this);
        label->setBuddy(box);
        grid->addWidget(label, row, 0);
        return box;
    };
    family_ = combo(tr("Family"), "family");
    grid->addWidget(family_, row++, 1);
    size_ = combo(tr("Size"), "size");
    smaller_ = new QToolButton(this);
    smaller_->setText(QStringLiteral("\u2212"));
    smaller_->setToolTip(tr("Smaller (PageDown)"));
    smaller_->setObjectName("smaller");
    larger_ = new QToolButton(this);
    larger_->setText(QStringLiteral("+"));
    larger_->setToolTip(tr("Larger (PageUp)"));
    larger_->setObjectName("larger");
    auto* sizes = new QHBoxLayout;
    sizes->addWidget(size_, 1);
    sizes->addWidget(smaller_);
    sizes->addWidget(larger_);
    grid->addLayout(sizes, row++, 1);
    kept_ = combo(tr("Size keeps"), "kept");
    kept_->addItems({tr("Resection"), tr("Entry")});
    kept_->setToolTip(
        tr("Which point stays in place when the size changes: the middle of the resection on the stem's "
           "axis, or the stem's lateral border there"));
    grid->addWidget(kept_, row++, 1);
    head_ = combo(tr("Head"), "head");
    grid->addWidget(head_, row++, 1);
    neck_ = combo(tr("Neck"), "neck");
    grid->addWidget(neck_, row++, 1);
    grid->setColumnStretch(1, 1);
    body()->addLayout(grid);

    auto* buttons = new QHBoxLayout;
    library_ = new QPushButton(tr("Library\u2026"), this);
    library_->setObjectName("library");
    automatic_ = new QPushButton(tr("Plan automatically"), this);
    automatic_->setObjectName("automatic");
    buttons->addWidget(library_);
    buttons->addWidget(automatic_, 1);
    body()->addLayout(buttons);
    lock_ = new QCheckBox(tr("Locked: nothing of the plan may be changed"), this);
    lock_->setObjectName("lock");
    body()->addWidget(lock_);

    connect(family_, QOverload<int>::of(&QComboBox::activated), this, [this](int i) {
        const ImplantShelf::Entry& entry = shelf_.entries[static_cast<std::size_t>(i)];
        if (entry.name != session_.state()->plan.family) use(entry.name, {});
    });
    connect(size_, QOverload<int>::of(&QComboBox::activated), this, [this](int i) {
        const std::string size = size_->itemText(i).toStdString();
        if (size != session_.state()->plan.size) use(session_.state()->plan.family, size);
    });
    connect(smaller_, &QToolButton::clicked, this, [this] { step(-1); });
    connect(larger_, &QToolButton::clicked, this, [this] { step(1); });
    connect(kept_, QOverload<int>::of(&QComboBox::activated), this, &ImplantSection::keptPointChanged);
    connect(head_, QOverload<int>::of(&QComboBox::activated), this, &ImplantSection::changeHead);
    connect(neck_, QOverload<int>::of(&QComboBox::activated), this, &ImplantSection::changeHead);
    connect(library_, &QPushButton::clicked, this, &ImplantSection::showLibrary);
    connect(automatic_, &QPushButton::clicked, &jobs_, &PlanJobs::planAutomatically);
    connect(lock_, &QCheckBox::clicked, this, [this](bool locked) {
        CaseState next = *session_.committed();
        next.plan.locked = locked;
        session_.commit(locked ? tr("Lock plan") : tr("Unlock plan"), std::move(next));
    });
    refresh();
}

KeptPoint ImplantSection::keptPoint() const {
    return kept_->currentIndex() == 1 ? KeptPoint::entry : KeptPoint::resection;
}

void ImplantSection::refresh() {
    const ImplantPlan& plan = session_.state()->plan;
    const ImplantFamily* family = shelf_.family(plan.family);
    QStringList families, sizes;
    int at_family = -1, at_size = -1;
    for (const ImplantShelf::Entry& entry : shelf_.entries) {
        if (entry.name == plan.family) at_family = static_cast<int>(families.size());
        families << QString::fromStdString(entry.name);
    }
    if (family) {
        for (const StemSize& size : family->sizes) {
            if (size.name == plan.size) at_size = static_cast<int>(sizes.size());
            sizes << QString::fromStdString(size.name);
        }
    }
    fill(*family_, families, at_family);
    fill(*size_, sizes, at_size);
    fill(*head_, family ? listed(family->heads_mm, false) : QStringList(),
         family ? indexOf(family->heads_mm, plan.head_mm) : -1);
    fill(*neck_, family ? listed(family->necks_mm, true) : QStringList(),
         family ? indexOf(family->necks_mm, plan.neck_mm) : -1);
    const bool open = !plan.locked;
    family_->setEnabled(open && !families.isEmpty());
    for (QComboBox* box : {size_, head_, neck_})
        box->setEnabled(open && family);
    smaller_->setEnabled(open && family && at_size > 0);
    larger_->setEnabled(open && family && at_size >= 0 && at_size + 1 < static_cast<int>(sizes.size()));
    library_->setEnabled(open);
    automatic_->setEnabled(jobs_.whyNot(PlanJobs::Job::automatic).isEmpty());
    automatic_->setToolTip(jobs_.whyNot(PlanJobs::Job::automatic));
    lock_->setChecked(plan.locked);
    lock_->setEnabled(plan.locked || plan.mesh);
    if (!shelf_.problems.isEmpty())
        setState(shelf_.problems, Tone::warning);
    else if (!plan.mesh)
        setState(tr("None is chosen yet: take one of the library, or plan automatically."));
    else if (!family)
        setState(plan.family.empty() ? tr("A mesh of its own.")
                                     : tr("%1 is not in the library.").arg(QString::fromStdString(plan.family)));
    else
        setState(QString::fromStdString(family->description));
}

// Where an implant was, the next one stands by the kept point; the first one in the seat that is known.
void ImplantSection::use(const std::string& family, const std::string& size) {
    CaseState state = *session_.committed();
    if (state.plan.locked) return;
    const bool first = !state.plan.mesh;
    if (family != state.plan.family) state.plan.family = family;
    // A head or neck that the other family does not have.
    if (const ImplantFamily* offered = shelf_.family(family)) {
        if (indexOf(offered->heads_mm, state.plan.head_mm) < 0) state.plan.head_mm = offered->heads_mm.front();
        if (indexOf(offered->necks_mm, state.plan.neck_mm) < 0) state.plan.neck_mm = offered->necks_mm.front();
    }
    Result<CaseState> next = withSize(state, size, keptPoint());
    if (!next) {
        setState(QString::fromStdString(next.error().message()), Tone::warning);
        return;
    }
    if (first) next->plan.femur_from_implant = seatOf(*next).seat.femurFromCavity(resectionOf(next->plan));
    session_.commit(tr("Choose implant"), std::move(*next));
}

void ImplantSection::step(int steps) {
    Result<CaseState> next = withNextSize(*session_.committed(), steps, keptPoint());
    if (next)
        session_.commit(steps > 0 ? tr("Larger implant") : tr("Smaller implant"), std::move(*next));
    else
        setState(QString::fromStdString(next.error().message()), Tone::warning);
}

void ImplantSection::changeHead() {
    CaseState state = *session_.committed();
    const ImplantFamily* family = shelf_.family(state.plan.family);
    if (!family || state.plan.locked || head_->currentIndex() < 0 || neck_->currentIndex() < 0) return;
    const auto cavities = state.plan.cavities;  // the stem is the same
    state.plan.head_mm = family->heads_mm[static_cast<std::size_t>(head_->currentIndex())];
    state.plan.neck_mm = family->necks_mm[static_cast<std::size_t>(neck_->currentIndex())];
    Result<CaseState> next = withSize(state, state.plan.size, KeptPoint::resection);
    if (!next) {
        setState(QString::fromStdString(next.error().message()), Tone::warning);
        return;
    }
    next->plan.cavities = cavities;
    session_.commit(tr("Choose head"), std::move(*next));
}

void ImplantSection::showLibrary() {
    auto* dialog = new QDialog(this);
    dialog->setAttribute(Qt::WA_DeleteOnClose);
    dialog->setWindowTitle(tr("Implants"));
    auto* layout = new QVBoxLayout(dialog);
    auto* library = new ImplantLibrary(shelf_, dialog);
    library->choose(session_.state()->plan.family, session_.state()->plan.size);
    layout->addWidget(library);
    connect(library, &ImplantLibrary::chosen, this, [this, dialog](const QString& family, const QString& size) {
        use(family.toStdString(), size.toStdString());
        dialog->accept();
    });
    dialog->resize(fontMetrics().averageCharWidth() * 110, fontMetrics().height() * 28);
    dialog->open();
}

}  // namespace fluorocut::ui

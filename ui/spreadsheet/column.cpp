#include "ui/spreadsheet/column.h"

#include <QCoreApplication>
#include <QJsonArray>
#include <QJsonDocument>
#include <QJsonObject>
#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "core/distortion/distortion_map.h"
#include "core/geometry/mesh_section.h"

namespace fluorocut::ui {
namespace {

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::ui::Column", text);
}

const CaseView& viewOf(const CaseState& state, std::size_t view) {
    if (view >= state.views.size()) throw std::logic_error("Column: there is no such view");
    return state.views[view];
}

// The cut whose picture a column shows, from 1; 0: there was none.
int cutOf(const Column& column, const CaseView& view) {
    return column.cut > 0 ? column.cut : static_cast<int>(view.after.size());
}

QString noImage(const TakenImage& taken) {
    return taken.image ? QString() : tr("No X-ray yet.");
}

QString unregistered(const TakenImage& taken) {
    if (taken.imager_from_femur) return {};
    const QString why = QString::fromStdString(taken.unregistered_because);
    return why.isEmpty() ? tr("View is not registered.") : tr("View is not registered: %1").arg(why);
}

// ---- X-ray

QString xrayMissing(const Column&, const CaseState& state, std::size_t view) {
    return noImage(viewOf(state, view).before);
}

void xrayInputs(const Column&, const CaseState& state, std::size_t view, Inputs& inputs) {
    inputs.add(viewOf(state, view).before.image);
}

Result<SharedImage> xray(const Column&, const CaseState& state, std::size_t view, ColumnMemory&, Progress&) {
    return viewOf(state, view).before.image;
}

// ---- dewarped

const DistortionMap* mapOfView(const CaseView& view) {
    return view.carm.distortion ? mapOf(*view.carm.distortion) : nullptr;
}

QString dewarpedMissing(const Column&, const CaseState& state, std::size_t view) {
    const CaseView& row = viewOf(state, view);
    if (const QString none = noImage(row.before); !none.isEmpty()) return none;
    if (row.carm.distortion && !mapOfView(row))
        return tr("The distortion of this imager was not measured with a plate.");
    return {};
}

void dewarpedInputs(const Column&, const CaseState& state, std::size_t view, Inputs& inputs) {
    inputs.add(viewOf(state, view).before.image).add(viewOf(state, view).carm.distortion);
}

Result<SharedImage> dewarped(const Column&, const CaseState& state, std::size_t view, ColumnMemory& memory,
                             Progress& progress) {
    const CaseView& row = viewOf(state, view);
    if (!row.carm.distortion) return row.before.image;  // straight as it is
    Inputs inputs;
    inputs.add(row.before.image).add(row.carm.distortion);
    return memory.dewarped.get(inputs, [&]() -> Result<Image> {
        progress.report(0, "straightening the picture");
        auto dewarper = memory.dewarpers.get(Inputs().add(row.carm.distortion),
                                             [&]() -> Result<Dewarper> { return Dewarper(*mapOfView(row)); });
        if (!dewarper) return dewarper.error();
        if (progress.isCancelled()) return cancelled("dewarped image");
        return (*dewarper)->dewarped(*row.before.image);
    });
}

// ---- predicted

std::shared_ptr<const TriangleMesh> cavityOf(const CaseState& state, int cut) {
    const auto& cavities = state.plan.cavities;
    if (cavities.empty()) return nullptr;
    if (cut < 1) return cavities.back();
    return cut <= static_cast<int>(cavities.size()) ? cavities[static_cast<std::size_t>(cut) - 1] : nullptr;
}

QString predictedMissing(const Column& column, const CaseState& state, std::size_t view, bool with_implant) {
    const CaseView& row = viewOf(state, view);
    if (const QString none = noImage(row.before); !none.isEmpty()) return none;
    if (const QString none = unregistered(row.before); !none.isEmpty()) return none;
    if (with_implant) return state.plan.mesh ? QString() : tr("No implant is chosen.");
    if (state.plan.cavities.empty()) return tr("The cavity is not worked out for this plan.");
    return cavityOf(state, column.cut) ? QString() : tr("The plan has no cut %1.").arg(column.cut);
}

Inputs solidsInputs(const CaseState& state, const std::shared_ptr<const TriangleMesh>& cavity, bool with_implant) {
    Inputs inputs;
    if (with_implant) inputs.add(state.plan.mesh).add(state.plan.implant);
    return inputs.add(cavity).add(with_implant ? 1 : 0);
}

Inputs placedInputs(const CaseState& state, const std::shared_ptr<const TriangleMesh>& cavity, bool with_implant) {
    return solidsInputs(state, cavity, with_implant).add(state.ct).add(state.plan.femur_from_implant);
}

Inputs viewInputs(const CaseView& view) {
    return Inputs().add(view.before.image).add(view.carm).add(view.before.imager_from_femur->target_from_source);
}

void predictedInputs(const CaseState& state, std::size_t view, const std::shared_ptr<const TriangleMesh>& cavity,
                     bool with_implant, Inputs& inputs) {
    const CaseView& row = viewOf(state, view);
    inputs = placedInputs(state, cavity, with_implant);
    inputs.add(row.before.image).add(row.carm);
    if (row.before.imager_from_femur) inputs.add(row.before.imager_from_femur->target_from_source);
}

// A mesh of which nothing else is known is taken for titanium; in its frame (`cavity`) the resection is the plane z =
// 0.
Result<Implant> implantOf(const CaseState& state) {
    if (state.plan.implant) return *state.plan.implant;
    Implant implant;
    implant.family = state.plan.family;
    implant.size = state.plan.size;
    implant.parts.push_back({"stem", Material::titanium, *state.plan.mesh});
    Result<HalfEdgeMesh> half_edges = HalfEdgeMesh::build(*state.plan.mesh, "implant");
    if (!half_edges) return half_edges.error();
    Result<TriangleMesh> below = partBelow(*half_edges, {});
    if (!below) return below.error();
    implant.in_bone = std::move(*below);
    return implant;
}

Result<SharedImage> predictedImage(const CaseState& state, std::size_t view,
                                   const std::shared_ptr<const TriangleMesh>& cavity, bool with_implant,
                                   ColumnMemory& memory, Progress& progress) {
    const CaseView& row = viewOf(state, view);
    progress.report(0, "preparing the plan");
    const auto solids = memory.solids.get(solidsInputs(state, cavity, with_implant), [&]() -> Result<PlannedSolids> {
        if (!with_implant) return PlannedSolids::prepare(nullptr, cavity.get());
        const Result<Implant> implant = implantOf(state);
        if (!implant) return implant.error();
        return PlannedSolids::prepare(&*implant, cavity.get());
    });
    if (!solids) return solids.error();
    if (progress.isCancelled()) return cancelled("predicted image");
    progress.report(0.3, "preparing the picture");
    const auto prepared = memory.views.get(viewInputs(row), [&] {
        return PredictedView::prepare(*row.before.image, row.carm, row.before.imager_from_femur->target_from_source);
    });
    if (!prepared) return prepared.error();
    if (progress.isCancelled()) return cancelled("predicted image");
    progress.report(0.5, "taking the bone away");
    const auto placed = memory.placed.get(placedInputs(state, cavity, with_implant), [&] {
        return placePlan(**solids, state.plan.femur_from_implant, state.ct.get());
    });
    if (!placed) return placed.error();
    if (progress.isCancelled()) return cancelled("predicted image");
    progress.report(0.7, "predicting the picture");
    Result<PredictedImage> predicted = (*prepared)->predict(**solids, **placed);
    if (!predicted) return predicted.error();
    return std::make_shared<const Image>(std::move(predicted->image));
}

QString predictedCutMissing(const Column& column, const CaseState& state, std::size_t view) {
    return predictedMissing(column, state, view, false);
}

void predictedCutInputs(const Column& column, const CaseState& state, std::size_t view, Inputs& inputs) {
    predictedInputs(state, view, cavityOf(state, column.cut), false, inputs);
}

Result<SharedImage> predictedCut(const Column& column, const CaseState& state, std::size_t view, ColumnMemory& memory,
                                 Progress& progress) {
    return predictedImage(state, view, cavityOf(state, column.cut), false, memory, progress);
}

QString predictedImplantMissing(const Column& column, const CaseState& state, std::size_t view) {
    return predictedMissing(column, state, view, true);
}

void predictedImplantInputs(const Column&, const CaseState& state, std::size_t view, Inputs& inputs) {
    predictedInputs(state, view, cavityOf(state, 0), true, inputs);
}

Result<SharedImage> predictedImplant(const Column&, const CaseState& state, std::size_t view, ColumnMemory& memory,
                                     Progress& progress) {
    return predictedImage(state, view, cavityOf(state, 0), true, memory, progress);
}

// ---- after a cut

const TakenImage& afterOf(const Column& column, const CaseState& state, std::size_t view) {
    const CaseView& row = viewOf(state, view);
    return row.after[static_cast<std::size_t>(cutOf(column, row)) - 1];
}

QString afterMissing(const Column& column, const CaseState& state, std::size_t view) {
    const CaseView& row = viewOf(state, view);
    const int cut = cutOf(column, row);
    if (row.after.empty()) return tr("No cut yet.");
    if (cut > static_cast<int>(row.after.size()) || !row.after[static_cast<std::size_t>(cut) - 1].image)
        return tr("No X-ray after cut %1 yet.").arg(cut);
    return {};
}

void afterInputs(const Column& column, const CaseState& state, std::size_t view, Inputs& inputs) {
    inputs.add(afterOf(column, state, view).image);
}

Result<SharedImage> after(const Column& column, const CaseState& state, std::size_t view, ColumnMemory&, Progress&) {
    return afterOf(column, state, view).image;
}

// ---- difference

QString differenceMissing(const Column& column, const CaseState& state, std::size_t view) {
    if (const QString none = afterMissing(column, state, view); !none.isEmpty()) return none;
    if (column.against == Against::before) return noImage(viewOf(state, view).before);
    Column predicted = column;
    predicted.cut = cutOf(column, viewOf(state, view));
    return predictedMissing(predicted, state, view, false);
}

void differenceInputs(const Column& column, const CaseState& state, std::size_t view, Inputs& inputs) {
    if (column.against == Against::prediction)
        predictedInputs(state, view, cavityOf(state, cutOf(column, viewOf(state, view))), false, inputs);
    else
        inputs.add(viewOf(state, view).before.image);
    inputs.add(afterOf(column, state, view).image);
}

Result<SharedImage> difference(const Column& column, const CaseState& state, std::size_t view, ColumnMemory& memory,
                               Progress& progress) {
    SharedImage reference = viewOf(state, view).before.image;
    if (column.against == Against::prediction) {
        Result<SharedImage> predicted =
            predictedImage(state, view, cavityOf(state, cutOf(column, viewOf(state, view))), false, memory, progress);
        if (!predicted) return predicted;
        reference = *predicted;
    }
    const Image& taken = *afterOf(column, state, view).image;
    if (taken.width() != reference->width() || taken.height() != reference->height())
        return invalidInput("difference of two images",
                            std::to_string(taken.width()) + " x " + std::to_string(taken.height()) + " pixels and " +
                                std::to_string(reference->width()) + " x " + std::to_string(reference->height()),
                            "images of one size", "take both with the same imager");
    Image result(taken.width(), taken.height());
    for (std::size_t p = 0; p < taken.size(); ++p)
        result.pixels()[p] = taken.pixels()[p] - reference->pixels()[p];
    return std::make_shared<const Image>(std::move(result));
}

// How far the implant's place lies apart in the two pictures: the C-arm does not come back exactly.
QString differenceNote(const Column& column, const CaseState& state, std::size_t view) {
    const CaseView& row = viewOf(state, view);
    const TakenImage& taken = afterOf(column, state, view);
    if (!taken.imager_from_femur || !row.before.imager_from_femur) return {};
    const Vector3 place = state.plan.femur_from_implant.translation();
    const double moved_px = (row.carm.project(taken.imager_from_femur->target_from_source * place) -
                             row.carm.project(row.before.imager_from_femur->target_from_source * place))
                                .norm();
    if (!(moved_px > 1)) return {};
    return tr("The bone lies %1 px elsewhere than before").arg(moved_px, 0, 'f', 1);
}

// ---- the table

struct Kind {
    const char* name;
    const char* title;
    bool has_cut = false;
    bool at_hand = false;  // costs nothing: the state holds it
    bool levels = false;
    std::set<OverlayKind> overlays = {};  // to begin with
    QString (*missing)(const Column&, const CaseState&, std::size_t);
    void (*inputs)(const Column&, const CaseState&, std::size_t, Inputs&);
    Result<SharedImage> (*compute)(const Column&, const CaseState&, std::size_t, ColumnMemory&, Progress&);
};

std::vector<Kind> makeKinds() {
    using enum OverlayKind;
    std::vector<Kind> table;
    table.push_back({.name = "xray",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "X-ray"),
                     .at_hand = true,
                     .levels = true,
                     .overlays = {beads, corkscrew},
                     .missing = xrayMissing,
                     .inputs = xrayInputs,
                     .compute = xray});
    table.push_back({.name = "dewarped",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "Dewarped"),
                     .levels = true,
                     .overlays = {beads, corkscrew},
                     .missing = dewarpedMissing,
                     .inputs = dewarpedInputs,
                     .compute = dewarped});
    // In the pixels that were taken, overlays bent like the picture: what the hand moves stays what was seen.
    table.push_back({.name = "plan",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "Plan"),
                     .at_hand = true,
                     .levels = true,
                     .overlays = {implant, stages, axis, beads, uncertainty},
                     .missing = xrayMissing,
                     .inputs = xrayInputs,
                     .compute = xray});
    table.push_back({.name = "predicted-cut",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "Predicted after cut"),
                     .has_cut = true,
                     .levels = true,
                     .overlays = {stages},
                     .missing = predictedCutMissing,
                     .inputs = predictedCutInputs,
                     .compute = predictedCut});
    table.push_back({.name = "predicted",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "Predicted with implant"),
                     .levels = true,
                     .overlays = {implant},
                     .missing = predictedImplantMissing,
                     .inputs = predictedImplantInputs,
                     .compute = predictedImplant});
    table.push_back({.name = "after",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "After cut"),
                     .has_cut = true,
                     .at_hand = true,
                     .levels = true,
                     .overlays = {cavity, uncertainty},
                     .missing = afterMissing,
                     .inputs = afterInputs,
                     .compute = after});
    table.push_back({.name = "difference",
                     .title = QT_TRANSLATE_NOOP("fluorocut::ui::Column", "Difference"),
                     .has_cut = true,
                     .overlays = {cavity},
                     .missing = differenceMissing,
                     .inputs = differenceInputs,
                     .compute = difference});
    return table;
}

const std::vector<Kind>& kinds() {
    static const std::vector<Kind> table = makeKinds();
    return table;
}

const Kind* findKind(const std::string& name) {
    const auto found =
        std::find_if(kinds().begin(), kinds().end(), [&](const Kind& kind) { return kind.name == name; });
    return found == kinds().end() ? nullptr : &*found;
}

const Kind& kindOf(const Column& column) {
    if (const Kind* kind = findKind(column.kind)) return *kind;
    throw std::logic_error("Column: no kind is called " + column.kind);
}

constexpr const char* kAgainst[] = {"before", "prediction"};

Error wrong(const QString& where, const QString& found, const std::string& expected) {
    return invalidInput(where.toStdString(), found.toStdString(), expected,
                        "delete the setting to have the standard columns");
}

Result<Column> columnFrom(const QJsonValue& value, const QString& where) {
    const QJsonObject object = value.toObject();
    Column column;
    column.id = object["id"].toString().toStdString();
    if (column.id.empty()) return wrong(where + ", id", "none", "a name");
    column.kind = object["kind"].toString().toStdString();
    if (!findKind(column.kind)) return wrong(where + ", kind", object["kind"].toString(), "a kind of column");
    column.title = object["title"].toString();
    const double cut = object["cut"].toDouble();
    if (!(cut >= 0 && cut <= 1000 && cut == static_cast<int>(cut)))
        return wrong(where + ", cut", QString::number(cut), "a whole number from 0 (the latest) to 1000");
    column.cut = static_cast<int>(cut);
    column.against = object["against"].toString() == kAgainst[1] ? Against::prediction : Against::before;
    column.hidden = object["hidden"].toBool();
    for (const QJsonValue& overlay : object["overlays"].toArray()) {
        const auto found = std::find_if(kOverlayKinds.begin(), kOverlayKinds.end(),
                                        [&](OverlayKind kind) { return overlay.toString() == name(kind); });
        if (found == kOverlayKinds.end()) return wrong(where + ", overlays", overlay.toString(), "a kind of overlay");
        column.overlays.insert(*found);
    }
    return column;
}

}  // namespace

std::vector<Column> columnsToChooseFrom() {
    std::vector<Column> columns;
    for (const Kind& kind : kinds())
        columns.push_back({.id = kind.name, .kind = kind.name, .overlays = kind.overlays});
    return columns;
}

std::vector<Column> standardColumns() {
    std::vector<Column> columns = columnsToChooseFrom();
    for (Column& column : columns)
        column.hidden = column.kind == "dewarped" || column.kind == "predicted-cut" || column.kind == "difference";
    return columns;
}

QString titleOf(const Column& column) {
    if (!column.title.isEmpty()) return column.title;
    QString title = tr(kindOf(column).title);
    if (hasCut(column) && column.cut > 0) title += QStringLiteral(" %1").arg(column.cut);
    if (column.kind == "difference")
        title =
            column.against == Against::before ? tr("%1 from before").arg(title) : tr("%1 from prediction").arg(title);
    return title;
}

bool hasCut(const Column& column) {
    return kindOf(column).has_cut;
}

bool showsLevels(const Column& column) {
    return kindOf(column).levels;
}

bool isAtHand(const Column& column) {
    return kindOf(column).at_hand;
}

QString missing(const Column& column, const CaseState& state, std::size_t view) {
    return kindOf(column).missing(column, state, view);
}

Inputs inputsOf(const Column& column, const CaseState& state, std::size_t view) {
    Inputs inputs;
    kindOf(column).inputs(column, state, view, inputs);
    return inputs;
}

Result<SharedImage> compute(const Column& column, const CaseState& state, std::size_t view, ColumnMemory& memory,
                            Progress& progress) {
    return kindOf(column).compute(column, state, view, memory, progress);
}

QString noteOf(const Column& column, const CaseState& state, std::size_t view) {
    if (column.kind != "difference" || !missing(column, state, view).isEmpty()) return {};
    return differenceNote(column, state, view);
}

Picture pictureOf(const Column& column, const CaseState& state, std::size_t view) {
    const CaseView& row = viewOf(state, view);
    Picture picture;
    picture.carm = row.carm;
    const bool after_cut =
        (column.kind == "after" || column.kind == "difference") && afterMissing(column, state, view).isEmpty();
    const TakenImage& taken = after_cut ? afterOf(column, state, view) : row.before;
    picture.imager_from_femur = taken.imager_from_femur;
    picture.imager_from_corkscrew = taken.imager_from_corkscrew;
    if (after_cut) picture.cut = cutOf(column, row);
    if (column.kind == "dewarped" && mapOfView(row)) picture.carm = straightened(*mapOfView(row), row.carm);
    return picture;
}

Result<std::vector<Column>> columnsFromJson(const QByteArray& json) {
    QJsonParseError problem;
    const QJsonDocument document = QJsonDocument::fromJson(json, &problem);
    if (!document.isArray())
        return wrong("columns of the spreadsheet",
                     document.isNull() ? problem.errorString() : QStringLiteral("no array"), "a JSON array of columns");
    std::vector<Column> columns;
    for (const QJsonValue& value : document.array()) {
        const QString where = QStringLiteral("columns of the spreadsheet, column %1").arg(columns.size() + 1);
        Result<Column> column = columnFrom(value, where);
        if (!column) return column.error();
        const bool twice =
            std::any_of(columns.begin(), columns.end(), [&](const Column& c) { return c.id == column->id; });
        if (twice) return wrong(where + ", id", QString::fromStdString(column->id) + " again", "a name of its own");
        columns.push_back(std::move(*column));
    }
    return columns;
}

QByteArray jsonOf(const std::vector<Column>& columns) {
    QJsonArray array;
    for (const Column& column : columns) {
        QJsonArray overlays;
        for (const OverlayKind kind : column.overlays)
            overlays.append(QString::fromLatin1(name(kind)));
        array.append(QJsonObject{{"id", QString::fromStdString(column.id)},
                                 {"kind", QString::fromStdString(column.kind)},
                                 {"title", column.title},
                                 {"cut", column.cut},
                                 {"against", kAgainst[static_cast<int>(column.against)]},
                                 {"overlays", overlays},
                                 {"hidden", column.hidden}});
    }
    return QJsonDocument(array).toJson(QJsonDocument::Compact);
}

}  // namespace fluorocut::ui

// Columns of the spreadsheet: each a formula that makes a picture of a view out of the case.
//
// What a column is (its kind) is one row of the table in column.cpp; which columns a sheet has, with their cut, what
// they are compared with and which overlays they show, are values (Column), kept as JSON:
//     [{"id": "cut-2", "kind": "after", "title": "", "cut": 2, "against": "before", "overlays": ["stages"],
//       "hidden": false}, ...]
//
// A new kind of column: one row in the table: its name (in files for ever), title, what it lacks (a sentence, empty
// when it can be worked out), its inputs, and the formula. The formula runs on any thread, reads nothing but what
// `inputs` names, and asks `progress` for cancellation at least every 100 ms.
#pragma once

#include <QByteArray>
#include <QString>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/distortion/dewarp.h"
#include "core/planning/predicted_image.h"
#include "ui/session/case_state.h"
#include "ui/spreadsheet/inputs.h"
#include "ui/spreadsheet/overlays.h"

namespace fluorocut::ui {

using SharedImage = std::shared_ptr<const Image>;

enum class Against { before, prediction };

struct Column {
    std::string id;      // one of its kind in the sheet
    std::string kind;    // "xray", "dewarped", "plan", "predicted-cut", "predicted", "after", "difference"
    QString title = {};  // given by hand; empty: the kind's own
    int cut = 0;         // of kinds that have one, from 1; 0: the latest
    Against against = Against::before;  // of a difference
    std::set<OverlayKind> overlays = {};
    bool hidden = false;

    friend bool operator==(const Column&, const Column&) = default;
};

// What formulas share with each other and from one state to the next. Safe to use from several threads.
struct ColumnMemory {
    Memo<Dewarper> dewarpers{8};
    Memo<Image> dewarped{16};
    Memo<PlannedSolids> solids{6};
    Memo<PlacedPlan> placed{3};
    Memo<PredictedView> views{16};
};

// The columns a sheet starts with.
std::vector<Column> standardColumns();

// All kinds, to choose from, as a new column of each would be.
std::vector<Column> columnsToChooseFrom();

QString titleOf(const Column& column);
bool hasCut(const Column& column);
// Levels of the detector, or something else (a difference), which another window suits.
bool showsLevels(const Column& column);

// Why there is nothing to be worked out; empty: there is.
QString missing(const Column& column, const CaseState& state, std::size_t view);
Inputs inputsOf(const Column& column, const CaseState& state, std::size_t view);
// Costs nothing: a picture that the state holds.
bool isAtHand(const Column& column);
Result<SharedImage> compute(const Column& column, const CaseState& state, std::size_t view, ColumnMemory& memory,
                            Progress& progress);
// What the picture does not say itself ("the C-arm moved ..."); mostly empty.
QString noteOf(const Column& column, const CaseState& state, std::size_t view);
// How points come into the column's picture of a view: its imager and poses.
Picture pictureOf(const Column& column, const CaseState& state, std::size_t view);

// invalidInput, in a sentence, for what is no list of columns.
Result<std::vector<Column>> columnsFromJson(const QByteArray& json);
QByteArray jsonOf(const std::vector<Column>& columns);

}  // namespace fluorocut::ui

#include "ui/spreadsheet/cell_engine.h"

#include <QElapsedTimer>
#include <QTest>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"

namespace fluorocut::ui {
namespace {

using namespace std::chrono_literals;

std::shared_ptr<const Image> flat(float level) {
    return std::make_shared<const Image>(16, 16, level);
}

CaseState twoViews() {
    CaseState state;
    for (const char* name : {"AP", "lateral"}) {
        CaseView view;
        view.name = name;
        view.carm.columns = view.carm.rows = 16;
        view.before.image = flat(1);
        view.before.imager_from_femur = Pose{Frame::imager, Frame::femur, Rigid3::fromTranslation({0, 0, 600}), {}};
        state.views.push_back(view);
    }
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeStem());
    return state;
}

CaseState movedTo(CaseState state, double x) {
    state.plan.femur_from_implant = Rigid3::fromTranslation({x, 0, 0});
    return state;
}

// Formulas that tell what was asked of them; of a picture's level one sees which state it is of. While `gate` is closed
// they go on until they are cancelled.
struct Bench {
    std::mutex mutex;
    std::map<CellKey, int> asked;
    std::atomic<bool> gate{true};
    std::atomic<bool> fails{false}, throws{false};
    std::atomic<int> cancelled_jobs{0};
    std::chrono::steady_clock::time_point cancelled_at;

    CellEngine::Formula formula() {
        return [this](const Column& column, const CaseState& state, std::size_t view, ColumnMemory&,
                      Progress& progress) -> Result<SharedImage> {
            {
                const std::scoped_lock lock(mutex);
                ++asked[{view, column.id}];
            }
            if (throws) throw std::logic_error("seen from here");
            if (fails) return noSolution("prediction", "nothing", "something");
            if (isAtHand(column)) return state.views[view].before.image;
            while (!gate) {
                if (progress.isCancelled()) {
                    const std::scoped_lock lock(mutex);
                    cancelled_at = std::chrono::steady_clock::now();
                    ++cancelled_jobs;
                    return cancelled("prediction");
                }
                std::this_thread::sleep_for(1ms);
            }
            const float base = 100 * ((*state.views[view].before.image)(0, 0) - 1);
            return flat(base + static_cast<float>(state.plan.femur_from_implant.translation().x()));
        };
    }
    int count(const CellKey& key) {
        const std::scoped_lock lock(mutex);
        return asked[key];
    }
};

const std::vector<Column> kColumns{{.id = "xray", .kind = "xray"}, {.id = "predicted", .kind = "predicted"}};
const CellKey kXray{0, "xray"}, kPredicted{0, "predicted"}, kOther{1, "predicted"};

class CellEngineTest : public testing::Test {
  protected:
    CellEngineTest() : engine_(session_, nullptr, bench_.formula()) {
        engine_.setColumns(kColumns);
        engine_.setVisible({kXray, kPredicted, kOther});
        session_.open(movedTo(twoViews(), 1));
    }
    bool settles() {
        return QTest::qWaitFor([this] { return engine_.isIdle(); }, 20000);
    }
    float level(const CellKey& key) {
        const CellPicture picture = engine_.picture(key);
        return picture.image ? (*picture.image)(0, 0) : -1;
    }

    Bench bench_;
    Session session_;
    CellEngine engine_;
};

TEST_F(CellEngineTest, WorksEveryCellOutOnce) {
    EXPECT_EQ(engine_.picture(kXray).image, session_.state()->views[0].before.image);  // at hand: at once
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kPredicted), 1);
    EXPECT_EQ(bench_.count(kPredicted), 1);
    EXPECT_EQ(bench_.count(kOther), 1);
}

TEST_F(CellEngineTest, WorksOutAnewExactlyWhatReadsWhatChanged) {
    ASSERT_TRUE(settles());
    CaseState state = *session_.state();
    state.patient = "somebody else";
    state.views[0].before.registration_mm = 0.7;
    session_.commit("rename", state);
    ASSERT_TRUE(settles());
    EXPECT_EQ(bench_.count(kPredicted), 1);

    // The pose of one view: that view's prediction only.
    state.views[1].before.imager_from_femur->target_from_source = Rigid3::fromTranslation({0, 0, 601});
    session_.commit("register", state);
    ASSERT_TRUE(settles());
    EXPECT_EQ(bench_.count(kPredicted), 1);
    EXPECT_EQ(bench_.count(kOther), 2);

    session_.commit("move", movedTo(*session_.state(), 5));
    ASSERT_TRUE(settles());
    EXPECT_EQ(bench_.count(kPredicted), 2);
    EXPECT_EQ(bench_.count(kOther), 3);
    EXPECT_EQ(level(kPredicted), 5);
}

TEST_F(CellEngineTest, ShowsTheOldPictureAsStaleUntilTheNewOneIsThere) {
    ASSERT_TRUE(settles());
    EXPECT_FALSE(engine_.picture(kPredicted).stale);
    bench_.gate = false;
    session_.commit("move", movedTo(*session_.state(), 7));
    EXPECT_EQ(level(kPredicted), 1);
    EXPECT_TRUE(engine_.picture(kPredicted).stale);
    EXPECT_FALSE(engine_.picture(kXray).stale);
    bench_.gate = true;
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kPredicted), 7);
    EXPECT_FALSE(engine_.picture(kPredicted).stale);
}

TEST_F(CellEngineTest, GoingBackBeforeItIsDoneNeedsNoWork) {
    ASSERT_TRUE(settles());
    bench_.gate = false;
    session_.preview(movedTo(*session_.state(), 7));
    EXPECT_TRUE(engine_.picture(kPredicted).stale);
    session_.dropPreview();
    EXPECT_FALSE(engine_.picture(kPredicted).stale);
    ASSERT_TRUE(settles());  // what had begun was cancelled
    EXPECT_EQ(level(kPredicted), 1);
}

// Of three tries the best: on a busy machine any one may be late.
TEST_F(CellEngineTest, CancelsWhatIsOutdatedWithin200Ms) {
    ASSERT_TRUE(settles());
    double best_ms = 1e9;
    for (int attempt = 0; attempt < 3; ++attempt) {
        bench_.gate = false;
        const int before = bench_.count(kPredicted);
        session_.commit("move", movedTo(*session_.state(), 10 + attempt));
        ASSERT_TRUE(QTest::qWaitFor([&] { return bench_.count(kPredicted) > before; }, 20000));
        const int cancelled_before = bench_.cancelled_jobs;
        const auto outdated = std::chrono::steady_clock::now();
        session_.commit("move on", movedTo(*session_.state(), 20 + attempt));
        ASSERT_TRUE(QTest::qWaitFor([&] { return bench_.cancelled_jobs > cancelled_before; }, 20000));
        {
            const std::scoped_lock lock(bench_.mutex);
            best_ms =
                std::min(best_ms, std::chrono::duration<double, std::milli>(bench_.cancelled_at - outdated).count());
        }
        bench_.gate = true;
        ASSERT_TRUE(settles());
        EXPECT_EQ(level(kPredicted), 20 + attempt);
    }
    EXPECT_LT(best_ms, 200);
}

TEST_F(CellEngineTest, WhileTheHandMovesPicturesALittleLateAreShown) {
    ASSERT_TRUE(settles());
    int shown = 0;
    QObject::connect(&engine_, &CellEngine::changed, [&](const CellKey& key) {
        if (key == kPredicted && level(kPredicted) >= 50) ++shown;
    });
    QElapsedTimer time;
    time.start();
    for (int i = 0; time.elapsed() < 500; ++i) {
        session_.preview(movedTo(*session_.committed(), 50 + i));
        QTest::qWait(5);
    }
    EXPECT_GT(shown, 5);
}

TEST_F(CellEngineTest, DuringAPreviewOnlyWhatIsOnTheScreenIsWorkedOut) {
    ASSERT_TRUE(settles());
    engine_.setVisible({kXray, kPredicted});
    const int before = bench_.count(kOther);
    session_.preview(movedTo(*session_.state(), 3));
    ASSERT_TRUE(QTest::qWaitFor([&] { return level(kPredicted) == 3; }, 20000));
    QTest::qWait(30);
    EXPECT_EQ(bench_.count(kOther), before);
    session_.commit("move", movedTo(*session_.state(), 3));
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kOther), 3);
}

TEST_F(CellEngineTest, NeverShowsThePictureOfAnotherView) {
    ASSERT_TRUE(settles());
    bench_.gate = false;
    session_.commit("move", movedTo(*session_.state(), 9));
    CaseState state = *session_.state();
    state.views[0].before.image = flat(2);  // taken again, while the old one is being worked on
    session_.commit("take again", state);
    EXPECT_EQ(engine_.picture(kPredicted).image, nullptr);
    bench_.gate = true;
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kPredicted), 109);
}

TEST_F(CellEngineTest, SaysWhyThereIsNoPicture) {
    ASSERT_TRUE(settles());
    CaseState state = *session_.state();
    state.views[0].before.imager_from_femur.reset();
    state.views[0].before.unregistered_because = "only 2 beads were found";
    session_.commit("lose it", state);
    EXPECT_EQ(engine_.picture(kPredicted).image, nullptr);
    EXPECT_EQ(engine_.picture(kPredicted).why, "View is not registered: only 2 beads were found");
    session_.undo();
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kPredicted), 1);
}

TEST_F(CellEngineTest, AFailureIsASentenceInItsCell) {
    ASSERT_TRUE(settles());
    bench_.fails = true;
    session_.commit("move", movedTo(*session_.state(), 2));
    ASSERT_TRUE(settles());
    EXPECT_TRUE(engine_.picture(kPredicted).failed);
    EXPECT_EQ(engine_.picture(kPredicted).why, "prediction: found nothing, expected something.");
    EXPECT_EQ(engine_.picture(kPredicted).image, nullptr);
    bench_.fails = false;
    bench_.throws = true;
    session_.commit("move", movedTo(*session_.state(), 3));
    ASSERT_TRUE(settles());
    EXPECT_TRUE(engine_.picture(kPredicted).why.contains("seen from here"));
    bench_.throws = false;
    session_.commit("move", movedTo(*session_.state(), 4));
    ASSERT_TRUE(settles());
    EXPECT_EQ(level(kPredicted), 4);
}

TEST_F(CellEngineTest, MayGoWhileItWorks) {
    bench_.gate = false;
    auto engine = std::make_unique<CellEngine>(session_, nullptr, bench_.formula());
    engine->setColumns(kColumns);
    const int before = bench_.cancelled_jobs;
    engine.reset();
    EXPECT_GT(bench_.cancelled_jobs, before);
    bench_.gate = true;
    ASSERT_TRUE(settles());
}

}  // namespace
}  // namespace fluorocut::ui

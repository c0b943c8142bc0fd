// Paths that were spoilt on purpose: both envelope checks, each by itself, must refuse every one of them.
//
// Whether a spoilt path really is dangerous is asked of neither check: `mostBeyond` samples it against the shape's own
// formula, and only faults of more than kMargin count (a draw that happens to do no harm is drawn again).
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/cutting/envelope_check.h"
#include "tests/core/cutting/cavities.h"

namespace fluorocut {
namespace {

constexpr double kMargin = 0.25;  // mm: what the voxel check promises to see, 0.05 + 0.25 / 2, is less
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Good {
    std::string name;
    CavityShape shape;
    TriangleMesh envelope;
    ToolPath path;
    double open_mm;
};

std::vector<Good> goodPaths() {
    struct Case {
        std::string name;
        CavityShape shape;
        TriangleMesh mesh;
        double tilt;
    };
    const CavityShape cone = moved(coneCavity(4, 6.5, 18), {9, 3}), ring = ringCavity(4, 13, 8),
                      bowed = moved(bowedCavity(4.5, 30, 120), {-2, 7});
    std::vector<Good> good;
    for (const Case& c : {Case{"cone", cone, meshOf(cone, 20, 72), 0}, Case{"ring", ring, ringMesh(4, 13, 8, 144), 0},
                          Case{"bowed", bowed, meshOf(bowed, 20, 72), 0.2}}) {
        ToolPathOptions options;
        options.most_tilt_rad = c.tilt;
        options.cutter.length_mm = 60;
        const Result<ToolPath> path = planToolPath(fieldOf(c.shape, 0.5), 0, options);
        EXPECT_TRUE(path) << c.name;
        const double open = options.openPlane(0);
        const Result<TriangleMesh> envelope = openedUpward(c.mesh, open);
        EXPECT_TRUE(envelope) << c.name;
        if (path && envelope) good.push_back({c.name, c.shape, *envelope, *path, open});
    }
    return good;
}

using Faults = std::function<void(ToolPath&, Random&)>;
struct Fault {
    std::string name;
    Faults spoil;
    bool of_numbers = false;  // nothing to do with where the cutter goes: wrong by itself
};

std::size_t anyMove(const ToolPath& path, Random& random) {
    return static_cast<std::size_t>(random.below(path.moves.size()));
}

Vector3 anyDirection(Random& random) {
    return Vector3(random.normal(), random.normal(), random.normal()).normalized();
}

void everyPlace(ToolPath& path, const std::function<void(Vector3&)>& change) {
    for (ToolMove& move : path.moves) {
        change(move.segment.from_mm);
        change(move.segment.to_mm);
    }
}

// A place where two moves meet goes elsewhere, and both with it.
void moveJoint(ToolPath& path, std::size_t after, const Vector3& by) {
    path.moves[after].segment.to_mm += by;
    if (after + 1 < path.moves.size()) path.moves[after + 1].segment.from_mm += by;
}

std::vector<Fault> faults() {
    return {
        {"one place pushed",
         [](ToolPath& p, Random& r) { moveJoint(p, anyMove(p, r), r.uniform(0.3, 3) * anyDirection(r)); }},
        {"one move pushed",
         [](ToolPath& p, Random& r) {
             const std::size_t i = 1 + static_cast<std::size_t>(r.below(p.moves.size() - 1));
             const Vector3 by = r.uniform(0.3, 3) * anyDirection(r);
             moveJoint(p, i - 1, by);
             moveJoint(p, i, by);
         }},
        {"whole path shifted",
         [](ToolPath& p, Random& r) {
             const Vector3 by = r.uniform(0.3, 3) * anyDirection(r);
             everyPlace(p, [&](Vector3& x) { x += by; });
         }},
        {"everything below a height too deep",
         [](ToolPath& p, Random& r) {
             const double z = r.uniform(-14, 0), by = r.uniform(0.3, 3);
             everyPlace(p, [&](Vector3& x) { x.z() -= x.z() < z ? by : 0; });
         }},
        {"all spindles tilted",
         [](ToolPath& p, Random& r) {
             const Vector3 by = r.uniform(0.03, 0.3) * anyDirection(r);
             for (ToolMove& move : p.moves)
                 move.segment.spindle = (move.segment.spindle + by).normalized();
         }},
        {"x and y exchanged", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { std::swap(x.x(), x.y()); }); }},
        {"x and z exchanged", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { std::swap(x.x(), x.z()); }); }},
        {"mirrored",
         [](ToolPath& p, Random& r) {
             const int axis = static_cast<int>(r.below(2));
             everyPlace(p, [&](Vector3& x) { x[axis] = -x[axis]; });
         }},
        {"upside down", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { x.z() = -x.z(); }); }},
        {"metres for millimetres", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { x /= 1000; }); }},
        {"millimetres for metres", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { x *= 1000; }); }},
        {"inches", [](ToolPath& p, Random&) { everyPlace(p, [](Vector3& x) { x *= 25.4; }); }},
        {"scaled",
         [](ToolPath& p, Random& r) {
             const double by = r.uniform(1.03, 1.3);
             everyPlace(p, [&](Vector3& x) { x *= by; });
         }},
        {"turned about z",
         [](ToolPath& p, Random& r) {
             const Eigen::AngleAxisd turn(r.uniform(0.1, 6.2), Vector3::UnitZ());
             everyPlace(p, [&](Vector3& x) { x = turn * x; });
         }},
        {"a larger cutter than planned for", [](ToolPath& p, Random& r) { p.cutter.radius_mm += r.uniform(0.3, 2); }},
        {"corners cut off: places left out of a loop",
         [](ToolPath& p, Random& r) {
             const std::size_t i = anyMove(p, r), left_out = 2 + static_cast<std::size_t>(r.below(40));
             if (i + left_out + 1 >= p.moves.size()) return;
             p.moves[i].segment.to_mm = p.moves[i + left_out].segment.to_mm;
             p.moves.erase(p.moves.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                           p.moves.begin() + static_cast<std::ptrdiff_t>(i + left_out) + 1);
         }},
        {"a way up and over left out, its ends joined",
         [](ToolPath& p, Random& r) {
             // From somewhere low straight to somewhere else.
             const std::size_t i = anyMove(p, r), k = anyMove(p, r);
             if (i + 1 >= k) return;
             p.moves[k].segment.from_mm = p.moves[i].segment.to_mm;
             p.moves.erase(p.moves.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                           p.moves.begin() + static_cast<std::ptrdiff_t>(k));
         }},
        {"two places far apart in the path exchanged",
         [](ToolPath& p, Random& r) {
             const std::size_t i = anyMove(p, r), k = anyMove(p, r);
             const Vector3 by = p.moves[k].segment.to_mm - p.moves[i].segment.to_mm;
             moveJoint(p, i, by);
             moveJoint(p, k, -by);
         }},

        {"not a number",
         [](ToolPath& p, Random& r) {
             ToolMove& m = p.moves[anyMove(p, r)];
             Vector3* const fields[] = {&m.segment.from_mm, &m.segment.to_mm, &m.segment.spindle};
             (*fields[r.below(3)])[static_cast<Eigen::Index>(r.below(3))] =
                 r.below(2) ? kNaN : std::numeric_limits<double>::infinity();
         },
         true},
        {"spindle not a unit vector",
         [](ToolPath& p, Random& r) {
             p.moves[anyMove(p, r)].segment.spindle *= r.below(2) ? 0 : r.uniform(1.01, 100);
         },
         true},
        {"spindle the other way",
         [](ToolPath& p, Random& r) {
             ToolMove& m = p.moves[anyMove(p, r)];
             m.segment.spindle = -m.segment.spindle;
         },
         true},
        {"feed not above zero",
         [](ToolPath& p, Random& r) {
             const double feeds[] = {0, -5, kNaN, std::numeric_limits<double>::infinity()};
             p.moves[anyMove(p, r)].feed_mm_s = feeds[r.below(4)];
         },
         true},
        {"a jump: a move left out",
         [](ToolPath& p, Random& r) {
             p.moves.erase(p.moves.begin() + static_cast<std::ptrdiff_t>(1 + r.below(p.moves.size() - 2)));
         },
         true},
        {"spindle turned in the cavity",
         [](ToolPath& p, Random& r) {
             std::size_t i = anyMove(p, r);
             while (p.moves[i].motion != ToolMotion::cut)
                 i = anyMove(p, r);
             p.moves[i].segment.spindle = (p.moves[i].segment.spindle + Vector3(0.01, 0, 0)).normalized();
         },
         true},
        {"a shank too short", [](ToolPath& p, Random& r) { p.cutter.length_mm = r.uniform(4, 12); }, true},
    };
}

TEST(SeededFaultsSlow, BothChecksRefuseEverySpoiltPathAndNoGoodOne) {
    const std::vector<Good> good = goodPaths();
    ASSERT_EQ(good.size(), 3u);
    for (const Good& g : good) {
        EXPECT_LE(mostBeyond(g.path, g.shape, g.open_mm), 0.02) << g.name;
        EXPECT_TRUE(checkByMesh(g.path, g.envelope)->passed()) << g.name;
        EXPECT_TRUE(checkByVoxels(g.path, g.envelope)->passed()) << g.name;
        EXPECT_TRUE(checkToolPath(g.path, g.path.cutter, g.envelope)) << g.name;
    }
    const std::vector<Fault> kinds = faults();
    const Random seed(20261123);
    int spoilt = 0, draws = 0;
    for (std::size_t n = 0; spoilt < 200; ++n) {
        const Fault& fault = kinds[n % kinds.size()];
        const Good& g = good[n / kinds.size() % good.size()];
        Random random = seed.fork(n);
        ToolPath path;
        double beyond = 0;
        for (int draw = 0; draw < 50 && !(beyond > kMargin); ++draw, ++draws) {
            path = g.path;
            fault.spoil(path, random);
            beyond = fault.of_numbers ? std::numeric_limits<double>::infinity() : mostBeyond(path, g.shape, g.open_mm);
        }
        // Some do no harm to some shapes: a ring is the same mirrored.
        if (!(beyond > kMargin)) continue;
        ++spoilt;
        const std::string label =
            fault.name + ", " + g.name + ", number " + std::to_string(n) + ", " + std::to_string(beyond) + " mm beyond";
        const Result<EnvelopeVerdict> mesh = checkByMesh(path, g.envelope), voxels = checkByVoxels(path, g.envelope);
        ASSERT_TRUE(mesh && voxels) << label;
        EXPECT_FALSE(mesh->passed()) << "mesh: " << label;
        EXPECT_FALSE(voxels->passed()) << "voxels: " << label;
        if (spoilt % 20 == 0) {
            EXPECT_FALSE(checkToolPath(path, path.cutter, g.envelope)) << label;
        }
    }
    RecordProperty("draws", draws);
}

}  // namespace
}  // namespace fluorocut

#include "core/planning/templating.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/geometry/half_edge_mesh.h"
#include "core/geometry/mesh_section.h"
#include "core/imaging/standard_views.h"
#include "core/io/resources.h"
#include "core/planning/containment.h"
#include "core/planning/contour_file.h"
#include "core/planning/femur_shaft.h"
#include "core/planning/implant_file.h"
#include "core/simulation/femur_phantom.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

std::vector<Implant> sizesOf(const std::string& entry, Side side) {
    const auto path = findResource("implants", entry);
    EXPECT_OK(path);
    const auto family = readImplantFamily(*path);
    EXPECT_OK(family);
    std::vector<Implant> sizes;
    for (const StemSize& size : family->sizes) {
        ImplantChoice choice;
        choice.size = size.name;
        choice.side = side;
        auto implant = makeImplant(*family, choice);
        EXPECT_OK(implant);
        sizes.push_back(std::move(*implant));
    }
    return sizes;
}

// The middles of the stem's triangles that lie in bone, by a choice of its own.
std::vector<Vector3> surfaceOf(const Implant& implant, std::size_t most) {
    std::vector<Vector3> points;
    for (const SurfacePoint& p : surfacePoints(implant.in_bone, most))
        if (p.position.z() < -0.3) points.push_back(p.position);
    return points;
}

// Nelder and Mead's simplex, started again from its best three times.
using Vector5 = Eigen::Matrix<double, 5, 1>;
std::pair<Vector5, double> minimised(const std::function<double(const Vector5&)>& f, Vector5 start) {
    double best = f(start);
    for (const double size : {1.0, 0.5, 0.2}) {
        std::array<std::pair<double, Vector5>, 6> s;
        s[0] = {best, start};
        for (int i = 0; i < 5; ++i) {
            Vector5 p = start;
            p[i] += size * (i < 2 ? 1.0 : 0.015);
            s[static_cast<std::size_t>(i) + 1] = {f(p), p};
        }
        for (int step = 0; step < 150; ++step) {
            std::sort(s.begin(), s.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
            Vector5 middle = Vector5::Zero();
            for (std::size_t i = 0; i < 5; ++i)
                middle += s[i].second / 5;
            const auto along = [&](double t) {
                const Vector5 p = middle + t * (s[5].second - middle);
                return std::pair<double, Vector5>(f(p), p);
            };
            auto next = along(-1);
            if (next.first < s[0].first) {
                const auto farther = along(-2);
                if (farther.first < next.first) next = farther;
            } else if (next.first >= s[4].first) {
                next = along(next.first < s[5].first ? -0.5 : 0.5);
                if (next.first >= s[5].first) {
                    for (std::size_t i = 1; i < 6; ++i) {
                        s[i].second = s[0].second + 0.5 * (s[i].second - s[0].second);
                        s[i].first = f(s[i].second);
                    }
                    continue;
                }
            }
            s[5] = next;
        }
        std::sort(s.begin(), s.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
        best = s[0].first;
        start = s[0].second;
    }
    return {start, best};
}

// The generated femur's own shape, and what fits into it by searching poses directly.
struct Truth {
    FemurShape shape;
    bool right;
    TemplateOptions options;

    double excess(const Vector3& p) const {
        const auto walls = shape.walls(right ? Vector3(-p.x(), p.y(), p.z()) : p);
        return std::max(walls.inner - options.most_reaming_mm,
                        std::min(walls.inner, walls.outer + options.least_wall_mm));
    }
    double excess(const std::vector<Vector3>& points, const Rigid3& pose) const {
        double most = -1e9;
        for (const Vector3& p : points)
            most = std::max(most, excess(pose * p));
        return most;
    }
    // `also`: poses worth starting from.
    std::pair<Rigid3, double> search(const Implant& implant, const StemSeat& seat,
                                     const std::vector<Rigid3>& also) const {
        const std::vector<Vector3> points = surfaceOf(implant, 700);
        // From the shaft's true axis at the resection and the stem's tip.
        const auto axisAt = [&](double z) {
            const Vector3 p = shape.shaftAxis(z);
            return right ? Vector3(-p.x(), p.y(), p.z()) : p;
        };
        StemSeat start = seat;
        const double z = seat.point.z();
        start.axis = (axisAt(z - 20) - axisAt(z - implant.stem_length_mm)).normalized();
        start.point = axisAt(z - 20);
        start.point += (seat.point - start.point).dot(seat.axis) / start.axis.dot(seat.axis) * start.axis;
        const Rigid3 first = start.femurFromCavity();
        const Vector3 e1 = seat.axis.unitOrthogonal(), e2 = seat.axis.cross(e1);
        const auto pose = [&](const Vector5& x) {
            Vector6 delta;
            delta << x[0] * e1 + x[1] * e2, x.tail<3>();
            return first.perturbed(delta);
        };
        std::pair<Rigid3, double> best{first, 1e9};
        std::vector<Vector5> starts;
        for (const double turn : {0.0, 0.2, -0.2}) {
            starts.emplace_back(Vector5::Zero());
            starts.back().tail<3>() = turn * seat.axis;
        }
        for (const Rigid3& known : also) {
            const Vector6 delta = known.deltaFrom(first);
            starts.emplace_back(Vector5::Zero());
            starts.back() << e1.dot(delta.head<3>()), e2.dot(delta.head<3>()), delta.tail<3>();
        }
        for (const Vector5& x : starts) {
            const auto [found, value] = minimised([&](const Vector5& y) { return excess(points, pose(y)); }, x);
            if (value < best.second) best = {pose(found), value};
        }
        best.second = excess(surfaceOf(implant, 6000), best.first);
        return best;
    }
};

FemurOptions variedFemur(std::uint64_t seed) {
    Random random(900 + seed);
    FemurOptions options;
    options.side = seed % 4 == 3 ? BodySide::right : BodySide::left;
    options.dorr = seed % 2 == 0 ? DorrType::B : DorrType::C;
    options.head_diameter_mm = random.uniform(45, 54);
    options.femoral_offset_mm = random.uniform(36, 50);
    options.neck_shaft_angle_rad = radiansFromDegrees(random.uniform(120, 135));
    options.anteversion_rad = radiansFromDegrees(random.uniform(5, 22));
    options.bow_radius_mm = random.uniform(900, 1800);
    // Wide enough for the family's smallest stem at least: 13 to 19 mm (a straight stem in a bow needs room).
    options.isthmus_canal_mm = random.uniform(13, 19);
    options.pelvis = false;
    options.voxel_mm = 1;
    options.seed = seed;
    return options;
}

// Walls as two views show them of a canal that leaves `gap_mm` around a stem at a known pose, 30 mm longer than it.
std::vector<CanalView> viewsOfCanalAround(const Implant& implant, const Rigid3& femur_from_cavity, double gap_mm) {
    std::vector<CanalView> views;
    const auto mesh = HalfEdgeMesh::build(implant.in_bone);
    EXPECT_OK(mesh);
    const Vector3 target = femur_from_cavity * Vector3(0, 0, -0.5 * implant.stem_length_mm);
    for (const StandardView kind : {StandardView::ap, StandardView::lateral}) {
        CanalView view;
        view.name = kind == StandardView::ap ? "ap" : "lateral";
        view.view = {standardCArm(), standardView(kind, target, kStandardObjectDepthMm), Matrix6::Zero()};
        // Toward which side the columns rise: in the AP picture the patient's left, in the lateral one the front.
        const bool left = implant.side == Side::left;
        DrawnWall low{
            kind == StandardView::ap ? (left ? WallSide::medial : WallSide::lateral) : WallSide::posterior, false, {}};
        DrawnWall high{
            kind == StandardView::ap ? (left ? WallSide::lateral : WallSide::medial) : WallSide::anterior, false, {}};
        for (double below = 0.2; below < implant.stem_length_mm + 30; below += 4) {
            // The rounded tip says nothing about the canal: it goes on as wide as above it.
            const double at = std::min(below, implant.stem_length_mm - 12);
            Vector2 least(1e9, 0), most(-1e9, 0);
            for (const auto& polygon : sectionPolygons(*mesh, {Vector3(0, 0, -at), Vector3::UnitZ()}))
                for (const Vector3& p : polygon) {
                    const Vector2 out = gap_mm * p.head<2>().normalized();
                    const Vector3 q = femur_from_cavity * Vector3(p.x() + out.x(), p.y() + out.y(), -below);
                    const Vector2 pixel = view.view.carm.project(view.view.imager_from_world * q);
                    if (pixel.x() < least.x()) least = pixel;
                    if (pixel.x() > most.x()) most = pixel;
                }
            low.pixels.push_back(least);
            high.pixels.push_back(most);
        }
        view.walls = {low, high};
        views.push_back(std::move(view));
    }
    return views;
}

TEST(Templating, FromTwoViewsFindsTheStemThatTheCanalWasMadeFor) {
    for (const Side side : {Side::left, Side::right}) {
        const std::vector<Implant> sizes = sizesOf("straight", side);
        for (const std::size_t made_for : {std::size_t(2), std::size_t(7)}) {
            const double medial = side == Side::left ? -1 : 1;
            const Vector3 axis = Vector3(0.03, -0.05, 1).normalized();
            const Rigid3 truth = StemSeat{{4, -7, 30}, axis, Vector3(medial, -0.05, 0), side}.femurFromCavity();
            const std::vector<CanalView> views = viewsOfCanalAround(sizes[made_for], truth, 0.25);
            const auto seat = seatFromViews(views);
            ASSERT_OK(seat);
            EXPECT_EQ(seat->side, side);
            // The middle line of a canal with a medial flare leans: a start, not a result.
            EXPECT_LT(degreesFromRadians(std::acos(seat->axis.dot(axis))), 4);
            EXPECT_LT(std::abs((seat->point - truth.translation()).dot(axis)), 1.5);
            TemplateOptions options;
            options.most_reaming_mm = 0;
            const auto proposal = proposeStem(sizes, views, *seat, options);
            ASSERT_OK(proposal);
            EXPECT_EQ(proposal->size, sizes[made_for].size);
            EXPECT_THAT(proposal->next_size_reason, HasSubstr("into the cortex"));
            // There is 0.25 mm of room, and the seat may lie 1.5 mm higher or lower, where the flare is wider.
            const Vector3 tip(0, 0, -sizes[made_for].stem_length_mm);
            EXPECT_LT((proposal->femur_from_cavity * tip - truth * tip).norm(), 2);
            EXPECT_LT((proposal->femur_from_cavity.translation() - truth.translation()).norm(), 2);
            for (const FillLevel& level : proposal->fill)
                if (level.below_mm < sizes[made_for].stem_length_mm - 20) {
                    EXPECT_GT(level.medioLateral(), 0.9);
                    EXPECT_LT(level.medioLateral(), 1.02);
                    EXPECT_GT(level.anteroPosterior(), 0.88);
                }
            EXPECT_THAT(proposal->warnings, ::testing::Contains(HasSubstr("no outer wall")));
        }
    }
}

TEST(Templating, DrawnOuterWallsLimitTheReaming) {
    const std::vector<Implant> sizes = sizesOf("straight", Side::left);
    const Rigid3 truth = StemSeat{{0, 0, 0}, Vector3::UnitZ(), -Vector3::UnitX(), Side::left}.femurFromCavity();
    std::vector<CanalView> views = viewsOfCanalAround(sizes[3], truth, 0.2);
    const std::vector<CanalView> wide = viewsOfCanalAround(sizes[3], truth, 2.7);  // the outer surface: 2.5 mm of wall
    for (std::size_t v = 0; v < views.size(); ++v)
        for (DrawnWall wall : wide[v].walls) {
            wall.outer = true;
            views[v].walls.push_back(wall);
        }
    const auto seat = seatFromViews(views);
    ASSERT_OK(seat);
    TemplateOptions options;
    options.most_reaming_mm = 5;
    options.least_wall_mm = 2.3;  // 0.2 mm of reaming left: less than a size
    const auto limited = proposeStem(sizes, views, *seat, options);
    ASSERT_OK(limited);
    EXPECT_EQ(limited->size, sizes[3].size);
    EXPECT_THAT(limited->next_size_reason, HasSubstr("would leave a wall of"));
    options.least_wall_mm = 1.2;  // 1.3 mm: two sizes (0.5 mm each at the tip)
    const auto free = proposeStem(sizes, views, *seat, options);
    ASSERT_OK(free);
    EXPECT_EQ(free->size, sizes[5].size);
    EXPECT_TRUE(free->least_cut.cut);
    EXPECT_GT(free->least_cut.thickness_mm, 1.1);
}

TEST(Templating, RefusesViewsThatCannotSay) {
    const std::vector<Implant> sizes = sizesOf("straight", Side::left);
    const Rigid3 truth = StemSeat{{0, 0, 0}, Vector3::UnitZ(), -Vector3::UnitX(), Side::left}.femurFromCavity();
    std::vector<CanalView> views = viewsOfCanalAround(sizes[3], truth, 0.2);
    std::vector<CanalView> same{views[0], views[0]};
    EXPECT_THAT(seatFromViews(same).error().message(), HasSubstr("anterior and posterior"));
    std::vector<CanalView> half = views;
    half[1].walls.pop_back();
    EXPECT_THAT(seatFromViews(half).error().message(), HasSubstr("view lateral"));
    std::vector<CanalView> parallel = views;
    parallel[1].view = parallel[0].view;
    parallel[1].walls[0].pixels = parallel[0].walls[0].pixels;
    parallel[1].walls[1].pixels = parallel[0].walls[1].pixels;
    EXPECT_THAT(seatFromViews(parallel).error().message(), HasSubstr("20 degrees"));
    const auto seat = seatFromViews(views);
    ASSERT_OK(seat);
    EXPECT_THAT(proposeStem(sizesOf("straight", Side::right), views, *seat).error().message(), HasSubstr("left"));
    EXPECT_EQ(seat->side, Side::left);
    // Walls that end too high: no size is known to fit.
    for (CanalView& view : views)
        for (DrawnWall& wall : view.walls)
            wall.pixels.resize(12);
    EXPECT_THAT(proposeStem(sizes, views, *seat).error().message(), HasSubstr("beyond where the bone is known"));
}

TEST(ContourFile, IsReadStrictly) {
    const test::ScratchFolder scratch;
    const auto write = [&](const std::string& text) { std::ofstream(scratch / "c.json") << text; };
    write(R"({"schema": "fluorocut/contours/1", "walls": [
        {"side": "medial", "surface": "canal", "u_px": [1, 2.5, 3], "v_px": [10, 20, 30]},
        {"side": "anterior", "surface": "outer", "u_px": [5, 6], "v_px": [7, 8]}]})");
    const auto walls = readContours(scratch / "c.json");
    ASSERT_OK(walls);
    ASSERT_EQ(walls->size(), 2U);
    EXPECT_EQ(walls->at(0).pixels.at(1), Vector2(2.5, 20));
    EXPECT_EQ(walls->at(1).side, WallSide::anterior);
    EXPECT_TRUE(walls->at(1).outer);
    write(R"({"schema": "fluorocut/contours/1", "walls": [
        {"side": "medial", "surface": "canal", "u_px": [1, 2], "v_px": [10]}]})");
    EXPECT_THAT(readContours(scratch / "c.json").error().message(), HasSubstr("2 and 1 numbers"));
    write(R"({"schema": "fluorocut/contours/1", "walls": []})");
    EXPECT_THAT(readContours(scratch / "c.json").error().message(), HasSubstr("walls"));
    write(R"({"schema": "fluorocut/contours/1", "walls": [
        {"side": "upper", "surface": "canal", "u_px": [1, 2], "v_px": [1, 2]}]})");
    EXPECT_THAT(readContours(scratch / "c.json").error().message(), HasSubstr("upper"));
}

TEST(TemplatingSlow, FindsTheBestSizeOfTwentyGeneratedFemurs) {
    const std::vector<Implant> left = sizesOf("straight", Side::left), right = sizesOf("straight", Side::right);
    int exact = 0, near = 0, total = 0;
    double slowest_ms = 0;
    for (std::uint64_t seed = 0; total < 20 && seed < 40; ++seed) {
        const FemurOptions options = variedFemur(seed);
        const auto femur = generateFemur(options);
        ASSERT_OK(femur);
        const auto shaft = findFemurShaft(femur->ct);
        ASSERT_OK(shaft);
        const AxisLine axis{shaft->axis.distal, shaft->axis.proximal + 6 * shaft->axis.direction()};
        const auto walls = findBoneWalls(femur->ct, axis);
        ASSERT_OK(walls);
        const StemSeat seat{shaft->axis.proximal, shaft->axis.direction(), shaft->medial, shaft->side};
        const std::vector<Implant>& sizes = shaft->side == Side::left ? left : right;
        TemplateOptions fit;
        fit.most_reaming_mm = 1;
        const auto proposal = proposeStem(sizes, *walls, seat, fit);

        // The largest size that truly fits, by bisection: a larger stem of the family holds a smaller one.
        const auto shape = femurShape(options);
        ASSERT_OK(shape);
        const Truth truth{*shape, options.side == BodySide::right, fit};
        const auto searched = [&](std::size_t size) {
            std::vector<Rigid3> also;
            if (proposal)
                for (const SizeTrial& trial : proposal->trials)
                    if (trial.size == sizes[size].size && std::isfinite(trial.excess_mm))
                        also.push_back(trial.femur_from_cavity);
            return truth.search(sizes[size], seat, also);
        };
        int fits = -1, fails = static_cast<int>(sizes.size());
        std::pair<Rigid3, double> best, next;
        while (fails - fits > 1) {
            const int middle = (fits + fails) / 2;
            const auto found = searched(static_cast<std::size_t>(middle));
            (found.second <= 0 ? fits : fails) = middle;
            (found.second <= 0 ? best : next) = found;
        }
        if (fits < 0) {  // a bone too small for the family: refused, with the reason
            EXPECT_TRUE(!proposal || (proposal->size == sizes[0].size && next.second < 0.15)) << seed;
            if (!proposal) {
                EXPECT_THAT(proposal.error().message(), HasSubstr("into the cortex"));
            }
            continue;
        }
        ++total;
        if (!proposal) continue;
        const int at = static_cast<int>(
            std::find_if(sizes.begin(), sizes.end(), [&](const Implant& i) { return i.size == proposal->size; }) -
            sizes.begin());
        const Implant& implant = sizes[static_cast<std::size_t>(at)];
        const double truly = truth.excess(surfaceOf(implant, 6000), proposal->femur_from_cavity);
        const Vector3 tip(0, 0, -implant.stem_length_mm);
        printf("%2lu %-5s true %s (%.2f, next %.2f) proposed %s (%.2f, truly %.2f), %.0f ms", seed,
               std::string(name(seat.side)).c_str(), sizes[static_cast<std::size_t>(fits)].size.c_str(), best.second,
               next.second, proposal->size.c_str(), proposal->excess_mm, truly, proposal->elapsed_ms);
        exact += at == fits;
        near += std::abs(at - fits) <= 1;
        slowest_ms = std::max(slowest_ms, proposal->elapsed_ms);
        // What is proposed fits the true bone as well as it says: walls are found to some 0.1 mm.
        EXPECT_NEAR(truly, proposal->excess_mm, 0.3) << seed;
        if (at == fits) {
            printf(", tip %.2f top %.2f mm\n", (proposal->femur_from_cavity * tip - best.first * tip).norm(),
                   (proposal->femur_from_cavity.translation() - best.first.translation()).norm());
            // Nor is there a pose with much more room.
            EXPECT_LT(truly - best.second, 0.25) << seed;
        } else {
            printf("\n");
        }
        fflush(stdout);
        EXPECT_EQ(proposal->next_size_reason.empty(), at + 1 == static_cast<int>(sizes.size()));
        for (const FillLevel& level : proposal->fill) {
            EXPECT_GT(level.area, 0.1);
            EXPECT_LT(level.area, 1.4);  // reaming may take it over 1
        }
        EXPECT_GT(proposal->least_wall.thickness_mm, 0.5);
        if (proposal->least_cut.cut) {
            EXPECT_GT(proposal->least_cut.thickness_mm, 2 - 0.1);
        }
    }
    printf("exact %d, within one %d of %d, slowest %.0f ms\n", exact, near, total, slowest_ms);
    EXPECT_EQ(total, 20);
    EXPECT_EQ(near, 20);
    EXPECT_GE(exact, 17);
    EXPECT_LT(slowest_ms, 20000);  // unloaded: below 1 s
}

}  // namespace
}  // namespace fluorocut

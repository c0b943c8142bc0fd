// The corkscrew in the virtual operating room: path lengths against an independent program for the same shapes, and
// what the room makes of them.
#include "core/simulation/corkscrew_objects.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "core/io/resources.h"
#include "core/simulation/truth.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

CorkscrewLayout layoutNamed(const char* name) {
    auto path = findResource("fiducials", name);
    if (!path) throw std::runtime_error(path.error().message());
    auto layout = readCorkscrew(*path);
    if (!layout) throw std::runtime_error(layout.error().message());
    return *layout;
}

// Length inside a shape along from + s * along, |s| <= reach: marched in steps of 0.1 mm, every crossing bisected.
// `outside` is continuous and negative inside. (A chord shorter than a step may be missed.)
double marched(const Vector3& from, const Vector3& along, double reach,
               const std::function<double(const Vector3&)>& outside) {
    const double step = 0.1;
    double length = 0, s0 = -reach, f0 = outside(from + s0 * along);
    while (s0 < reach) {
        const double s1 = s0 + step, f1 = outside(from + s1 * along);
        if ((f0 < 0) != (f1 < 0)) {
            double low = s0, high = s1;
            for (int i = 0; i < 40; ++i) {
                const double middle = 0.5 * (low + high);
                ((outside(from + middle * along) < 0) == (f0 < 0) ? low : high) = middle;
            }
            length += f0 < 0 ? low - s0 : s1 - low;
        } else if (f0 < 0) {
            length += step;
        }
        s0 = s1;
        f0 = f1;
    }
    return length;
}

double outsideRing(const CorkscrewRing& ring, const Vector3& p) {
    return std::hypot(std::hypot(p.y(), p.z()) - ring.radius_mm, p.x() - ring.x_mm) - ring.wire_radius_mm;
}

// Distance from the helix' middle line less the wire's radius, by Newton's method from the nearest of 200 places; at
// the ends the wire is cut flat.
double outsideHelix(const CorkscrewHelix& helix, const Vector3& p) {
    const double s = helix.handedness == Handedness::right ? 1 : -1;
    const double turn = s * 2 * std::numbers::pi * helix.turns, pitch = helix.x_end_mm - helix.x_start_mm;
    const auto point = [&](double t) -> Vector3 {
        const double a = helix.phase_rad + turn * t;
        return {helix.x_start_mm + pitch * t, helix.radius_mm * std::cos(a), helix.radius_mm * std::sin(a)};
    };
    const auto speed = [&](double t) -> Vector3 {
        const double a = helix.phase_rad + turn * t;
        return {pitch, -helix.radius_mm * turn * std::sin(a), helix.radius_mm * turn * std::cos(a)};
    };
    // Farther from the cylinder that it is wound on than its radius: no need to look for the nearest place.
    const double aside = std::abs(std::hypot(p.y(), p.z()) - helix.radius_mm) - helix.wire_radius_mm;
    if (aside > 0.1) return aside;
    double best = 0;
    for (int i = -2; i <= 202; ++i)
        if ((point(i / 200.0) - p).norm() < (point(best) - p).norm()) best = i / 200.0;
    for (int i = 0; i < 4; ++i) {
        const Vector3 curve(0, -helix.radius_mm * turn * turn * std::cos(helix.phase_rad + turn * best),
                            -helix.radius_mm * turn * turn * std::sin(helix.phase_rad + turn * best));
        const Vector3 away = point(best) - p;
        best -= away.dot(speed(best)) / (speed(best).squaredNorm() + away.dot(curve));
    }
    const double beyond = std::max(-best, best - 1) * speed(0.5).norm();
    return std::max((point(best) - p).norm() - helix.wire_radius_mm, beyond);
}

double outsideCylinder(double radius, const std::array<double, 2>& x, const Vector3& p) {
    return std::max({std::hypot(p.y(), p.z()) - radius, x[0] - p.x(), p.x() - x[1]});
}

struct Differences {
    double mean = 0, rms = 0, most = 0;
    int count = 0;
};

// One part's picture against marching, over every `stride`-th pixel that either sees, grazing rays too.
Differences compare(const HeldObject& part, const CArm& carm, const Rigid3& imager_from_corkscrew,
                    const std::function<double(const Vector3&)>& outside) {
    const auto projector = MeshProjector::prepare(part.mesh, part.name);
    if (!projector) throw std::runtime_error(projector.error().message());
    const Image image = projector->project(carm, imager_from_corkscrew);
    const Rigid3 corkscrew_from_imager = imager_from_corkscrew.inverse();
    Differences found;
    for (int y = 1; y < carm.rows; y += 3) {
        for (int x = (y / 3) % 3; x < carm.columns; x += 3) {
            const Vector3 along = corkscrew_from_imager.rotate(carm.rayDirection(Vector2(x, y)));
            const Vector3 source = corkscrew_from_imager.translation();
            const Vector3 nearest = source - source.dot(along) * along;
            const double expected = nearest.norm() < 80 ? marched(nearest, along, 80, outside) : 0;
            if (expected == 0 && image(x, y) == 0) continue;
            const double difference = image(x, y) - expected;
            found.mean += difference;
            found.rms += difference * difference;
            found.most = std::max(found.most, std::abs(difference));
            ++found.count;
        }
    }
    found.mean /= found.count;
    found.rms = std::sqrt(found.rms / found.count);
    return found;
}

const HeldObject& partNamed(const std::vector<HeldObject>& parts, const std::string& name) {
    for (const HeldObject& part : parts)
        if (part.name == name) return part;
    throw std::runtime_error(name);
}

// Facets of a circle of radius r with n sides lie within e = r (pi / n)^2 / 3 of it: 0.2 um of the rod, 0.4 um of a
// wire. A chord is off by about that, by up to sqrt(8 r e) where it only grazes (0.15 mm of the rod, for one ray in
// thousands), and on average over the section by nothing: equal areas.
TEST(CorkscrewObjects, PathLengthsAreThoseOfTheRoundShapes) {
    const CorkscrewLayout layout = layoutNamed("corkscrew");
    const auto parts = heldCorkscrew("corkscrew", layout, HeldBy::robot, {});
    ASSERT_OK(parts);
    ASSERT_EQ(parts->size(), 5u);
    CArm carm;
    carm.columns = carm.rows = 300;
    carm.pixel_mm = {0.6, 0.6};
    carm.principal_point_px = {149.5, 149.5};
    const Rigid3 pose = Rigid3::fromTranslation({3, -4, 700}) * Rigid3::fromTwistRollPitch(0.7, 0.4, 0.3);
    const auto expectClose = [&](const std::string& name, int least_count,
                                 const std::function<double(const Vector3&)>& outside) {
        const Differences found = compare(partNamed(*parts, "corkscrew " + name), carm, pose, outside);
        EXPECT_GT(found.count, least_count) << name;
        EXPECT_LT(std::abs(found.mean), 3e-4) << name;
        EXPECT_LT(found.rms, 2e-3) << name;
        EXPECT_LT(found.most, 0.1) << name;
        RecordProperty(name, fmt::format("{} rays: mean {:.2e}, rms {:.2e}, most {:.2e}", found.count, found.mean,
                                         found.rms, found.most));
    };
    expectClose("wire", 200, [&](const Vector3& p) {
        double least = outsideHelix(layout.helix, p);
        for (const CorkscrewRing& ring : layout.rings)
            least = std::min(least, outsideRing(ring, p));
        return least;
    });
    expectClose("rod", 500,
                [&](const Vector3& p) { return outsideCylinder(layout.rod_radius_mm, layout.rod_x_mm, p); });
    expectClose("shaft", 50,
                [&](const Vector3& p) { return outsideCylinder(layout.shaft_radius_mm, layout.rod_x_mm, p); });
    // Beads come in closed form, tested elsewhere: here, that they are the layout's. Inscribed meshes hold 1e-3 less.
    const auto solid = corkscrewSolid(layout);
    ASSERT_OK(solid);
    ASSERT_EQ(solid->beads.size(), 3u);
    const auto sumOf = [](const Image& image) {
        return std::accumulate(image.pixels().begin(), image.pixels().end(), 0.0);
    };
    double expected = 0;
    for (const TriangleMesh& bead : solid->beads)
        expected += sumOf(MeshProjector::prepare(bead)->project(carm, pose, {8}));
    EXPECT_NEAR(sumOf(partNamed(*parts, "corkscrew beads").path_lengths(carm, pose, {8})), expected, 2e-3 * expected);
}

// Along the beam (y of the room, at zero angles) through a place of the axis that lies in the isocentre: what lies
// there, summed by hand, nothing counted twice.
TEST(CorkscrewObjects, TheRoomAddsPartsAsMaterialsDisplaceEachOther) {
    OperatingRoomOptions options = OperatingRoomOptions().withoutErrors();
    options.nominal_carm.columns = options.nominal_carm.rows = 21;
    options.nominal_carm.principal_point_px = {10, 10};
    options.nominal_carm.pixel_mm = {0.032, 0.032};  // narrow: chords do not change within one
    options.planned_room_from_robot = Rigid3::identity();
    const CorkscrewLayout layout = layoutNamed("corkscrew-paper");
    const double rod = attenuationPerMm(layout.rod), shaft = attenuationPerMm(layout.shaft);
    const double wire = attenuationPerMm(layout.wire);
    struct Place {
        double x_mm, expected;
    };
    const Place places[] = {
        {5, 3 * shaft + (20 - 3) * rod},                      // the helix crosses this plane at -21, -4.2 and 12.6
        {27, 3 * shaft + 2 * 1 * wire + (20 - 3 - 2) * rod},  // in the plane of a ring
        {43, 3 * shaft},                                      // beyond the rod
    };
    for (const HeldBy holder : {HeldBy::robot, HeldBy::room, HeldBy::patient}) {
        for (const Place& place : places) {
            auto room = VirtualOperatingRoom::create(nullptr, options);
            ASSERT_OK(room);
            const auto parts = heldCorkscrew("corkscrew", layout, holder, Rigid3::fromTranslation({-place.x_mm, 0, 0}));
            ASSERT_OK(parts);
            for (const HeldObject& part : *parts)
                ASSERT_OK(room->hold(part));
            ImageRequest request;
            request.position = CArmPosition{};
            const auto acquired = room->acquire(request, Progress::none());
            ASSERT_OK(acquired);
            EXPECT_NEAR(-std::log(acquired->image(10, 10)), place.expected, 2e-4 * place.expected) << place.x_mm;
        }
    }
}

}  // namespace
}  // namespace fluorocut

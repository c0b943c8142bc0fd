#include "core/simulation/soft_tissue.h"

#include <limits>

#include "core/simulation/implicit.h"

namespace fluorocut {

using namespace implicit;

namespace {

// Beyond this difference between the two nearest muscles there is no fat plane.
constexpr double kPlaneReach = 3.0;  // mm: 2.2 and the waviness of the plane

}  // namespace

SoftTissue::SoftTissue(double scale, const Vector3& head_center, double fat_mm, std::uint64_t seed)
    : scale_(scale), fat_mm_(fat_mm), noise_(seed ^ 0xc2b2ae35u) {
    // Courses from an atlas' cross sections, for a left thigh with the joint at (-43, -9, 48); from, to, radii, which
    // muscle.
    const double thigh = 160;
    muscles_ = {
        {{0, -46, -thigh}, {-12, -46, 10}, 17, 13, 0},  // rectus femoris
        {{-12, -46, 10}, {-38, -42, 78}, 13, 7, 0},
        {{40, -14, -thigh}, {30, -16, -40}, 26, 20, 1},  // vastus lateralis
        {{30, -16, -40}, {24, -10, 22}, 20, 6, 1},
        {{10, -22, -thigh}, {8, -22, -20}, 18, 8, 2},     // vastus intermedius
        {{-32, -26, -thigh}, {-16, -18, -25}, 20, 6, 3},  // vastus medialis
        {{-50, -30, -thigh}, {-30, -68, -20}, 9, 9, 4},   // sartorius
        {{-30, -68, -20}, {12, -62, 90}, 9, 8, 4},
        {{-68, 14, -thigh}, {-86, 16, 0}, 8, 8, 5},      // gracilis
        {{-36, 24, -thigh}, {-62, 38, -20}, 24, 22, 6},  // adductor magnus
        {{-6, 16, -110}, {-70, 36, 0}, 5, 20, 6},
        {{-50, -8, -thigh}, {-62, -20, -60}, 13, 17, 7},  // adductor longus
        {{-62, -20, -60}, {-88, -30, 10}, 17, 9, 7},
        {{-22, 4, -30}, {-82, -4, -5}, 9, 14, 8},       // adductor brevis
        {{22, 50, -thigh}, {-18, 58, -40}, 17, 12, 9},  // biceps femoris
        {{-18, 58, -40}, {-58, 44, 0}, 12, 9, 9},
        {{-8, 60, -thigh}, {-40, 60, -20}, 14, 9, 10},   // semitendinosus
        {{-32, 54, -thigh}, {-56, 54, -10}, 14, 9, 11},  // semimembranosus
        {{20, 30, -85}, {0, 72, 20}, 3, 26, 12},         // gluteus maximus
        {{0, 72, 20}, {-75, 84, 90}, 26, 24, 12},
        {{24, 44, 10}, {-20, 62, 80}, 10, 26, 12},
        {{18, 4, 52}, {22, 18, 110}, 6, 24, 13},      // gluteus medius
        {{16, -8, 50}, {12, -14, 110}, 6, 18, 14},    // gluteus minimus
        {{40, -20, -110}, {38, -42, 40}, 2, 12, 15},  // tensor fasciae latae
        {{38, -42, 40}, {28, -54, 105}, 12, 14, 15},
        {{-20, 14, 0}, {-40, -34, 38}, 7, 13, 16},  // iliopsoas
        {{-40, -34, 38}, {-52, -44, 110}, 13, 20, 16},
        {{-14, 8, -22}, {-80, -34, 38}, 6, 11, 17},         // pectineus
        {{-8, 22, 12}, {-60, 34, 0}, 9, 10, 18},            // quadratus femoris, obturator externus
        {{-8, 18, 46}, {-72, 44, 66}, 6, 12, 19},           // piriformis, obturator internus
        {{-36, -36, -thigh}, {-42, -56, 0}, 4.5, 4.5, 20},  // femoral vessels
        {{-42, -56, 0}, {-56, -62, 80}, 4.5, 5, 20},
        {{-8, 42, -thigh}, {-22, 46, 10}, 4, 4, 21},      // sciatic nerve
        {{-120, -20, 40}, {-120, -30, 110}, 40, 50, 22},  // what lies in the pelvis
    };
    const Vector3 typical_head(-42, -9, 48);
    const Vector3 moved = head_center / scale - typical_head;
    // The thigh goes on below, as far as a volume may reach.
    for (std::size_t n = 0, count = muscles_.size(); n < count; ++n) {
        const Muscle m = muscles_[n];
        if (m.from.z() == -thigh) {
            muscles_.push_back({{m.from.x(), m.from.y(), -400}, m.from, m.radius_from, m.radius_from, m.owner});
        }
    }
    for (Muscle& muscle : muscles_) {
        for (Vector3* end : {&muscle.from, &muscle.to}) {
            // Medial origins at the pelvis go with the joint, insertions on the femur do not.
            if (end->x() < -30 && end->z() > -20) *end += moved;
            *end *= scale;
        }
        muscle.radius_from *= scale;
        muscle.radius_to *= scale;
    }
}

double SoftTissue::skin(const Vector3& p) const {
    const Vector3 q = p / scale_;
    const double lumps = 1.5 * noise_(q / 45);
    // Thigh: an ellipse that grows toward the groin, fuller behind.
    const double up = std::clamp((q.z() + 160) / 200, -1.0, 1.6);
    const double grow = up * (1.35 - 0.35 * up);
    const double half_x = 74 + 10 * grow, half_y = 78 + 8 * grow;
    const double cx = -10 - 6 * grow, cy = 4 + 3 * grow;
    const double x = q.x() - cx, y = q.y() - cy;
    // A little squarer than an ellipse.
    const double angle = std::atan2(y / half_y, x / half_x);
    const double round = 1 + 0.025 * std::sin(2 * angle) - 0.03 * std::cos(3 * angle);
    const double thigh = ellipse(x, y, half_x * round, half_y * round);
    // Trunk: from the groin upward, its lower border rising outward, so that it fades into the side of the thigh.
    const double trunk = smoothIntersection(ellipse(q.x() + 135, q.y() - 4, 196 + 0.1 * (q.z() - 48), 99),
                                            -(q.z() - 2 - 0.55 * (q.x() + 70) - 0.12 * q.y()), 55);
    return scale_ * (smoothUnion(thigh, trunk, 40) + lumps);
}

double SoftTissue::Muscle::distance(const Vector3& p) const {
    return roundCone(p, from, to, radius_from, radius_to);
}

SoftTissue::Box::Slow SoftTissue::slowAt(const Vector3& p) const {
    Box::Slow slow;
    slow.skin = skin(p);
    slow.variation = noise_(p / 14);
    // Subcutaneous fat varies, and is thicker at the side of the hip than down the thigh.
    slow.fat_thickness = fat_mm_ * (1 + 0.35 * noise_(p / 60 + Vector3(5, 9, 1)) + 0.0025 * p.z());
    // Bellies are not straight bars.
    slow.bent = p + 4 * Vector3(noise_(p / 34), noise_(p / 34 + Vector3(13, 5, 2)), 2 * noise_(p / 40));
    return slow;
}

SoftTissue::Box SoftTissue::box(const Vector3& low, const Vector3& high) const {
    Box box;
    box.owner_ = this;
    box.low_ = low;
    box.size_ = high - low;
    for (std::size_t n = 0; n < 8; ++n) {
        const Vector3 corner(n & 1 ? high.x() : low.x(), n & 2 ? high.y() : low.y(), n & 4 ? high.z() : low.z());
        box.corners_[n] = slowAt(corner);
    }
    box.lowest_skin_ = box.highest_skin_ = box.corners_[0].skin;
    for (const Box::Slow& corner : box.corners_) {
        box.lowest_skin_ = std::min(box.lowest_skin_, corner.skin);
        box.highest_skin_ = std::max(box.highest_skin_, corner.skin);
    }
    if (box.lowest_skin_ > 0) return box;

    // Distances change by no more than the way, and the bending stretches ways by less than a half.
    const Vector3 middle = 0.5 * (box.corners_[0].bent + box.corners_[7].bent);
    const double reach = 1.5 * 0.5 * box.size_.norm();
    double nearest = std::numeric_limits<double>::infinity();
    for (const Muscle& m : muscles_)
        nearest = std::min(nearest, m.distance(middle));
    const double limit = nearest + 2 * reach + kPlaneReach;
    for (std::size_t n = 0; n < muscles_.size(); ++n)
        if (muscles_[n].distance(middle) < limit) box.near_.push_back(n);
    return box;
}

SoftTissue::Box::Slow SoftTissue::Box::slow(const Vector3& p) const {
    const Vector3 t = (p - low_).cwiseQuotient(size_);
    Slow sum{0, 0, 0, Vector3::Zero()};
    for (std::size_t n = 0; n < 8; ++n) {
        const double weight = (n & 1 ? t.x() : 1 - t.x()) * (n & 2 ? t.y() : 1 - t.y()) * (n & 4 ? t.z() : 1 - t.z());
        sum.skin += weight * corners_[n].skin;
        sum.variation += weight * corners_[n].variation;
        sum.fat_thickness += weight * corners_[n].fat_thickness;
        sum.bent += weight * corners_[n].bent;
    }
    return sum;
}

double SoftTissue::Box::skin(const Vector3& p) const {
    return slow(p).skin;
}

double SoftTissue::Box::tissue(const Vector3& p) const {
    const Slow here = slow(p);
    const LatticeNoise& noise = owner_->noise_;
    const double depth = -here.skin;
    if (depth < 1.5) return -10;  // skin proper
    const double fat = kFatHu + 6 * here.variation;
    const double inside = smoothStep(here.fat_thickness - 1, here.fat_thickness + 1, depth);
    double subcutaneous = fat;
    if (inside < 1) {  // with septa
        subcutaneous += 45 * std::max(0.0, noise({p.x() / 9, p.y() / 9, p.z() / 25}) - 0.55);
        if (inside <= 0) return subcutaneous;
    }

    double first = std::numeric_limits<double>::infinity(), second = first;
    int owner = -1;
    for (const std::size_t n : near_) {
        const Muscle& m = owner_->muscles_[n];
        const double d = m.distance(here.bent);
        if (d < first) {
            if (m.owner != owner) second = first;
            first = d;
            owner = m.owner;
        } else if (d < second && m.owner != owner) {
            second = d;
        }
    }
    // Fat planes of some 1.5 mm between muscles, and fat that no muscle fills.
    const double plane = smoothStep(0.3, 2.2, second - first + 0.8 * noise(p / 8 + Vector3(3, 3, 3)));
    const double claimed = smoothStep(7, 3.5, first);
    const double belly = kMuscleHu + 4.0 * std::sin(2.4 * owner) + 5 * here.variation -
                         22 * std::max(0.0, noise({p.x() / 3.5, p.y() / 3.5, p.z() / 30}) - 0.35);
    const double between = -62 + 10 * here.variation;
    const double muscle = between + plane * claimed * (belly - between);
    return subcutaneous + inside * (muscle - subcutaneous);
}

}  // namespace fluorocut

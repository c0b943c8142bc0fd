// The only real calibrated X-rays with a CT at hand: a wrist in two cameras 65 degrees apart, and the CT of its radius
// (shared data, biplane/). Our projection of the CT through the two real cameras, at the pose that fits best, is held
// against the pictures; the two pictures are held against each other by triangulation.
//
// What this can show: that camera matrix, rotation, translation and pixel centres are used as others mean them, that
// the projector's bone is where the picture's is, and that both views tell one pose. It has no true pose to compare
// with.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/units.h"
#include "core/imaging/rays.h"
#include "core/imaging/volume_projector.h"
#include "core/io/image_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;

// "camera matrix" and three lines of numbers, ...
std::vector<double> numbersAfter(const fs::path& file, const std::string& title) {
    std::ifstream stream(file);
    std::string line;
    std::vector<double> numbers;
    while (std::getline(stream, line) && line.rfind(title, 0) != 0) {
    }
    while (std::getline(stream, line) && !line.empty() && line != "\r") {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream values(line);
        double value;
        while (values >> value)
            numbers.push_back(value);
    }
    return numbers;
}

// Only the ratio of focal length and pixel is known; a pixel of 0.2 mm is as good as any.
View camera(const fs::path& file) {
    const std::vector<double> k = numbersAfter(file, "camera matrix"), r = numbersAfter(file, "rotation"),
                              t = numbersAfter(file, "translation"), size = numbersAfter(file, "image size");
    View view;
    EXPECT_EQ(k.size(), 9U);
    EXPECT_EQ(r.size(), 9U);
    EXPECT_EQ(t.size(), 3U);
    if (k.size() != 9 || r.size() != 9 || t.size() != 3 || size.size() != 2) return view;
    view.carm.columns = static_cast<int>(size[0]);
    view.carm.rows = static_cast<int>(size[1]);
    view.carm.focal_length_mm = 0.2 * k[0];
    view.carm.pixel_mm = {0.2, 0.2 * k[0] / k[4]};
    view.carm.principal_point_px = {k[2], k[5]};
    const Matrix3 rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
    view.imager_from_world = Rigid3(Eigen::Quaterniond(rotation), {t[0], t[1], t[2]});
    return view;
}

Image cropped(const Image& image, int x, int y, int width, int height, int binning) {
    Image part(width / binning, height / binning, 0);
    for (int v = 0; v < part.height(); ++v) {
        for (int u = 0; u < part.width(); ++u) {
            double sum = 0;
            for (int j = 0; j < binning; ++j)
                for (int i = 0; i < binning; ++i)
                    sum += image(x + u * binning + i, y + v * binning + j);
            // Attenuation, as the projector has it.
            part(u, v) = static_cast<float>(-std::log((sum / (binning * binning) + 1) / 256));
        }
    }
    return part;
}

struct Region {
    int x, y, width, height;
};

// Correlation of the gradients of both images where the projected bone is, and a little around it: mean of both
// components. 1: the same edges.
double gradientCorrelation(const Image& bone, const Image& seen) {
    double most = 0;
    for (const float value : bone.pixels())
        most = std::max(most, static_cast<double>(value));
    std::array<std::array<double, 5>, 2> sums{};  // a, b, aa, bb, ab
    double count = 0;
    constexpr int kMargin = 2;
    for (int y = 1; y + 1 < bone.height(); ++y) {
        for (int x = 1; x + 1 < bone.width(); ++x) {
            bool near = false;
            for (int j = std::max(0, y - kMargin); j <= std::min(bone.height() - 1, y + kMargin) && !near; j += kMargin)
                for (int i = std::max(0, x - kMargin); i <= std::min(bone.width() - 1, x + kMargin); i += kMargin)
                    near = near || bone(i, j) > 0.02 * most;
            if (!near) continue;
            count += 1;
            const double a[2] = {double(bone(x + 1, y)) - bone(x - 1, y), double(bone(x, y + 1)) - bone(x, y - 1)};
            const double b[2] = {double(seen(x + 1, y)) - seen(x - 1, y), double(seen(x, y + 1)) - seen(x, y - 1)};
            for (std::size_t k = 0; k < 2; ++k) {
                const double values[5] = {a[k], b[k], a[k] * a[k], b[k] * b[k], a[k] * b[k]};
                for (std::size_t i = 0; i < 5; ++i)
                    sums[k][i] += values[i];
            }
        }
    }
    if (count < 50) return -1;
    double mean = 0;
    for (const auto& s : sums) {
        const double aa = s[2] - s[0] * s[0] / count, bb = s[3] - s[1] * s[1] / count, ab = s[4] - s[0] * s[1] / count;
        mean += 0.5 * (aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0);
    }
    return mean;
}

class Biplane : public testing::Test {
  protected:
    void SetUp() override {
        const fs::path data = test::sharedData();
        if (data.empty() || !fs::exists(data / "biplane"))
            GTEST_SKIP() << "biplane/ is not in the shared test data; set FLUOROCUT_TEST_DATA to its folder";
        for (int i = 0; i < 2; ++i) {
            const std::string number = std::to_string(i + 1);
            views_[static_cast<std::size_t>(i)] = camera(data / "biplane" / ("xr_calib_wrist_cam0" + number + ".txt"));
            auto image = readImage(data / "biplane" / ("xr_rad_uln_cam0" + number + "_UND.0002.tif"));
            ASSERT_OK(image);
            images_[static_cast<std::size_t>(i)] = std::move(image->image);
        }
        // The stack's values stand above zero for bone: as attenuation, up to a factor.
        VolumeGrid grid;
        grid.size = {68, 86, 128};
        grid.spacing_mm = {0.396, 0.396, 0.625};
        grid.origin_mm = -0.5 * Vector3(67 * 0.396, 85 * 0.396, 127 * 0.625);
        Volume radius(grid, 0);
        for (int k = 0; k < 128; ++k) {
            const auto slice = readImage(data / "biplane" / "rad_dcm_cropped.tif", {.frame = k + 1});
            ASSERT_OK(slice);
            for (int j = 0; j < 86; ++j)
                for (int i = 0; i < 68; ++i)
                    radius(i, j, k) = slice->image(i, j) - 1000;
        }
        radius_ = std::make_shared<Volume>(radius);
        VolumeGrid turned = grid;
        turned.direction.col(2) *= -1;
        turned.origin_mm.z() *= -1;
        mirrored_ = std::make_shared<Volume>(turned, radius.voxels());
    }

    // The regions of both pictures that show the radius.
    static constexpr std::array<Region, 2> kRegions{{{640, 1088, 512, 640}, {400, 1088, 512, 640}}};

    struct Level {
        std::array<CArm, 2> carms;
        std::array<Image, 2> seen;
    };
    Level level(int binning) const {
        Level result;
        for (std::size_t i = 0; i < 2; ++i) {
            const Region& r = kRegions[i];
            result.carms[i] = views_[i].carm.cropped(r.x, r.y, r.width, r.height).binned(binning);
            result.seen[i] = cropped(images_[i], r.x, r.y, r.width, r.height, binning);
        }
        return result;
    }

    std::array<double, 2> similarity(const VolumeProjector& projector, const Level& at,
                                     const Rigid3& world_from_ct) const {
        std::array<double, 2> each{};
        for (std::size_t i = 0; i < 2; ++i) {
            each[i] = gradientCorrelation(projector.project(at.carms[i], views_[i].imager_from_world * world_from_ct),
                                          at.seen[i]);
        }
        return each;
    }

    // Pattern search over the perturbations of world_from_ct: steps halved until they are small.
    Rigid3 climb(const VolumeProjector& projector, const Level& at, Rigid3 pose, double step_mm, double step_rad,
                 double least_mm) const {
        const auto score = [&](const Rigid3& p) {
            const auto each = similarity(projector, at, p);
            return 0.5 * (each[0] + each[1]);
        };
        double best = score(pose);
        for (double scale = 1; scale * step_mm >= least_mm;) {
            bool better = false;
            for (int axis = 0; axis < 6; ++axis) {
                for (const double sign : {1.0, -1.0}) {
                    Vector6 d = Vector6::Zero();
                    d[axis] = sign * scale * (axis < 3 ? step_mm : step_rad);
                    const Rigid3 next = pose.perturbed(d);
                    const double value = score(next);
                    if (value > best) {
                        best = value;
                        pose = next;
                        better = true;
                        break;
                    }
                }
            }
            if (!better) scale *= 0.5;
        }
        return pose;
    }

    // The picture, the projected bone, and the bone's outline over the picture, for looking at.
    void show(const fs::path& folder, const VolumeProjector& projector, const Level& at, const Rigid3& pose) const {
        for (std::size_t i = 0; i < 2; ++i) {
            const Image bone = projector.project(at.carms[i], views_[i].imager_from_world * pose);
            const Image& seen = at.seen[i];
            const int width = bone.width();
            Image picture(3 * width, bone.height(), 0);
            const float most = *std::max_element(bone.pixels().begin(), bone.pixels().end());
            const auto inside = [&](int x, int y) { return bone(x, y) > 0.03F * most; };
            for (int y = 0; y < bone.height(); ++y) {
                for (int x = 0; x < width; ++x) {
                    picture(x, y) = 255 - 255 * std::clamp(seen(x, y) / 2.5F, 0.F, 1.F);
                    picture(width + x, y) = 255 - 255 * bone(x, y) / most;
                    const bool edge =
                        x > 0 && y > 0 && (inside(x, y) != inside(x - 1, y) || inside(x, y) != inside(x, y - 1));
                    picture(2 * width + x, y) = edge ? 255 : picture(x, y);
                }
            }
            ImageWriteOptions bytes;
            bytes.type = PixelType::uint8;
            EXPECT_OK(writeImage(folder / ("biplane" + std::to_string(i + 1) + ".png"), picture, bytes));
        }
    }

    // The six small dark disks in a region: darkest against a ring around them.
    static std::vector<Vector2> markers(const Image& image, const Region& region) {
        struct Spot {
            double depth;
            Vector2 place;
        };
        std::vector<Spot> spots;
        const auto ring = [&](int x, int y, double least, double most) {
            double sum = 0, count = 0;
            for (int j = -8; j <= 8; ++j) {
                for (int i = -8; i <= 8; ++i) {
                    const double r = std::hypot(i, j);
                    if (r < least || r > most) continue;
                    sum += image(x + i, y + j);
                    count += 1;
                }
            }
            return sum / count;
        };
        for (int y = region.y; y < region.y + region.height; ++y) {
            for (int x = region.x; x < region.x + region.width; ++x)
                spots.push_back({ring(x, y, 5, 7) - ring(x, y, 0, 2), {x, y}});
        }
        std::stable_sort(spots.begin(), spots.end(), [](const Spot& a, const Spot& b) { return a.depth > b.depth; });
        std::vector<Vector2> found;
        for (const Spot& spot : spots) {
            if (found.size() == 6) break;
            if (std::any_of(found.begin(), found.end(),
                            [&](const Vector2& other) { return (other - spot.place).norm() < 8; }))
                continue;
            // Centre of what is missing.
            const int x = static_cast<int>(spot.place.x()), y = static_cast<int>(spot.place.y());
            const double around = ring(x, y, 5, 7);
            Vector2 sum = Vector2::Zero();
            double mass = 0;
            for (int j = -4; j <= 4; ++j) {
                for (int i = -4; i <= 4; ++i) {
                    const double missing = std::max(0.0, around - image(x + i, y + j));
                    sum += missing * Vector2(x + i, y + j);
                    mass += missing;
                }
            }
            found.push_back(mass > 0 ? Vector2(sum / mass) : spot.place);
        }
        return found;
    }

    std::array<View, 2> views_;
    std::array<Image, 2> images_;
    std::shared_ptr<const Volume> radius_, mirrored_;
};

// Where the shaft and the distal end were seen by eye, to some 10 px: the bone's axis in the world.
struct Axis {
    Vector3 distal, shaft;
};
Axis roughAxis(const std::array<View, 2>& views) {
    const auto point = [&](Vector2 a, Vector2 b) {
        const auto found = triangulate({{views[0], a, 5}, {views[1], b, 5}});
        EXPECT_OK(found);
        return found ? found->point : Vector3::Zero().eval();
    };
    return {point({908, 1230}, {600, 1230}), point({914, 1660}, {568, 1660})};
}

TEST_F(Biplane, SlowTheRadiusProjectsOntoBothPictures) {
    const Axis axis = roughAxis(views_);
    const Vector3 down = (axis.shaft - axis.distal).normalized();
    struct Candidate {
        double score;
        Rigid3 pose;
        bool mirrored;
    };
    std::vector<Candidate> candidates;
    const Level coarse = level(8), middle = level(4), fine = level(2);
    std::array<std::unique_ptr<VolumeProjector>, 2> projectors;
    for (std::size_t m = 0; m < 2; ++m) {
        auto prepared = VolumeProjector::prepare(m == 0 ? radius_ : mirrored_);
        ASSERT_OK(prepared);
        projectors[m] = std::make_unique<VolumeProjector>(std::move(*prepared));
        // The stack runs from the joint to the shaft; mirrored, the other way.
        const Eigen::Quaterniond upright =
            Eigen::Quaterniond::FromTwoVectors(m == 0 ? Vector3::UnitZ() : Vector3(-Vector3::UnitZ()), down);
        for (int turn = 0; turn < 36; ++turn) {
            for (const double along : {32.0, 40.0, 48.0}) {
                const Rigid3 start(upright * Eigen::Quaterniond(Eigen::AngleAxisd(turn * M_PI / 18, Vector3::UnitZ())),
                                   axis.distal + along * down);
                const auto each = similarity(*projectors[m], coarse, start);
                candidates.push_back({0.5 * (each[0] + each[1]), start, m == 1});
            }
        }
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    candidates.resize(24);
    parallelFor(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const VolumeProjector& projector = *projectors[candidates[i].mirrored ? 1 : 0];
            candidates[i].pose = climb(projector, coarse, candidates[i].pose, 4, 0.12, 0.4);
            const auto each = similarity(projector, coarse, candidates[i].pose);
            candidates[i].score = 0.5 * (each[0] + each[1]);
        }
    });
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    const VolumeProjector& projector = *projectors[candidates[0].mirrored ? 1 : 0];
    Rigid3 pose = climb(projector, middle, candidates[0].pose, 1, 0.03, 0.1);
    pose = climb(projector, fine, pose, 0.3, 0.01, 0.02);
    const auto each = similarity(projector, fine, pose);

    // Poses that are as good as they can be made, but elsewhere: what chance gives.
    double elsewhere = 0;
    for (const Candidate& one : candidates) {
        const double angle = (one.pose.inverse() * candidates[0].pose).rotationAngle();
        if (one.mirrored != candidates[0].mirrored || angle > 0.2) elsewhere = std::max(elsewhere, one.score);
    }
    // Random poses, not improved, as a null distribution at the finest level.
    Random random(1);
    std::vector<double> null;
    for (int i = 0; i < 100; ++i) {
        Vector6 d;
        for (int k = 0; k < 6; ++k)
            d[k] = random.uniform(-1, 1) * (k < 3 ? 15 : 0.6);
        const auto one = similarity(projector, fine, pose.perturbed(d));
        null.push_back(0.5 * (one[0] + one[1]));
    }
    // Asked alone, how far would each picture shift the bone in its own plane?
    std::array<double, 2> shift{};
    for (std::size_t i = 0; i < 2; ++i) {
        const Rigid3& imager = views_[i].imager_from_world;
        double best = -1;
        for (double x = -1.5; x <= 1.5; x += 0.1) {
            for (double y = -1.5; y <= 1.5; y += 0.1) {
                const Rigid3 moved = imager.inverse() * Rigid3::fromTranslation({x, y, 0}) * imager * pose;
                const double value =
                    gradientCorrelation(projector.project(fine.carms[i], imager * moved), fine.seen[i]);
                if (value > best) {
                    best = value;
                    shift[i] = std::hypot(x, y);
                }
            }
        }
    }
    std::printf(
        "stack %s; coarse: gradient correlation %.3f, elsewhere at most %.3f; fine: %.3f and %.3f, 100 poses within 15 "
        "mm "
        "and 35 degrees: at most %.3f; each picture alone: shifted by %.2f and %.2f mm\n",
        candidates[0].mirrored ? "left-handed" : "right-handed", candidates[0].score, elsewhere, each[0], each[1],
        *std::max_element(null.begin(), null.end()), shift[0], shift[1]);

    EXPECT_GT(candidates[0].score, 1.3 * elsewhere);
    const double fine_score = 0.5 * (each[0] + each[1]);
    EXPECT_GT(fine_score, 1.5 * *std::max_element(null.begin(), null.end()));
    EXPECT_GT(each[0], 0.3);
    EXPECT_GT(each[1], 0.2);
    // Both pictures mean the same place: 1 mm is 6 px, and less than two voxels along the bone.
    EXPECT_LT(shift[0], 1);
    EXPECT_LT(shift[1], 1);
    // The bone lies where its axis was seen.
    EXPECT_LT(((pose * Vector3::Zero() - axis.distal).cross(down)).norm(), 6);
    if (const char* folder = std::getenv("FLUOROCUT_TEST_PICTURES")) show(folder, projector, fine, pose);
}

// Six lead markers near the radius, found in both pictures: their rays meet. That ties camera matrix, rotation,
// translation, pixel centres and the order of rows to what the calibration's makers meant.
TEST_F(Biplane, RaysOfTheSameMarkersMeet) {
    const std::vector<Vector2> first = markers(images_[0], {950, 1430, 60, 100}),
                               second = markers(images_[1], {490, 1420, 60, 110});
    ASSERT_EQ(first.size(), 6U);
    ASSERT_EQ(second.size(), 6U);
    const auto meeting = [&](const std::array<View, 2>& views, const std::vector<Vector2>& a,
                             const std::vector<Vector2>& b) {
        // Pairs whose rays miss each other least, one to one.
        std::vector<double> residuals;
        std::vector<bool> used(b.size(), false);
        for (const Vector2& one : a) {
            double best = 1e9;
            std::size_t which = 0;
            for (std::size_t j = 0; j < b.size(); ++j) {
                const auto line = epipolarLine(views[0], one, views[1]);
                if (!line || used[j]) continue;
                const double distance = std::abs(line->dot(Vector3(b[j].x(), b[j].y(), 1)));
                if (distance < best) {
                    best = distance;
                    which = j;
                }
            }
            used[which] = true;
            residuals.push_back(best);
        }
        double sum = 0;
        for (const double r : residuals)
            sum += r * r;
        return std::sqrt(sum / static_cast<double>(residuals.size()));
    };
    const double rms = meeting(views_, first, second);
    // As if rows were counted from below.
    std::vector<Vector2> up_first = first, up_second = second;
    for (std::size_t i = 0; i < 6; ++i) {
        up_first[i].y() = 1759 - up_first[i].y();
        up_second[i].y() = 1759 - up_second[i].y();
    }
    const double flipped = meeting(views_, up_first, up_second);
    std::printf("epipolar distance of 6 markers: %.2f px rms; with rows from below %.1f px\n", rms, flipped);
    EXPECT_LT(rms, 1.5);
    EXPECT_GT(flipped, 4 * rms);
}

}  // namespace
}  // namespace fluorocut

#include "core/cavity/seen_outline.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "core/cavity/region_pixels.h"

namespace fluorocut::cavity {
namespace {

constexpr const char* kStep = "cavity location";
constexpr double kMarginMm = 22;  // of the region around the cavity's shadow: there lies the bone's outer contour
constexpr double kMaskMm = 5;     // around the shadow: so far the cavity may lie off the plan

Error failed(const CavityView& view, const char* found, const char* wanted, const char* advice) {
    return noSolution(kStep, fmt::format("view {}: {}", view.name, found), wanted, advice);
}

Image wholeLog(const Image& image, const CArm& carm) {
    const Image ideal = idealImage(image, carm);
    return logOf(ideal, {0, 0, ideal.width(), ideal.height()}, 1);
}

Mask shadowMask(const Region& region, const Contour& outline, double margin_px) {
    Contour here;
    for (const Vector2& p : outline)
        here.emplace_back(p - Vector2(region.x, region.y));
    return filledMask(region.width, region.height, {here}, margin_px);
}

}  // namespace

PlaneSimilarity similarityByPoses(const CavityView& view, const TriangleMesh& mesh, const Rigid3& femur_from_cavity) {
    const CArm carm = view.carm.ideal();
    Contour after, before;
    for (const Vector3& vertex : mesh.vertices) {
        const Vector3 p = femur_from_cavity * vertex;
        const Vector2 a = carm.project(view.after_imager_from_femur * p),
                      b = carm.project(view.before_imager_from_femur * p);
        if (!a.allFinite() || !b.allFinite()) continue;
        after.push_back(a);
        before.push_back(b);
    }
    return after.empty() ? PlaneSimilarity{} : bestSimilarity(after, before);
}

Result<AlignedView> alignView(const CavityView& view, const TriangleMesh& mesh, const Silhouette& silhouette,
                              const Rigid3& planned, double margin_mm, int block_px) {
    if (view.before.empty()) return failed(view, "no image before the cut", "one of each view", "give it, or a CT");
    const CArm carm = view.carm.ideal();
    const auto region = regionOf(carm, mesh, view.after_imager_from_femur * planned, margin_mm, block_px);
    const auto outline = predictedOutline(silhouette, carm, view.after_imager_from_femur * planned);
    if (!region || !outline) {
        return failed(view, "a planned cavity whose shadow lies outside the image", "most of the cavity in the picture",
                      "give the pose and the C-arm that belong to this image");
    }
    AlignedView aligned;
    aligned.region = *region;
    aligned.mask = shadowMask(*region, *outline, kMaskMm * region->px_per_mm);
    aligned.log_before = wholeLog(view.before, view.carm);
    aligned.log_after = wholeLog(view.after, view.carm);
    const auto alignment = alignImages(aligned.log_before, aligned.log_after, *region, aligned.mask,
                                       similarityByPoses(view, mesh, planned));
    if (!alignment) {
        return failed(view, "an image before the cut that cannot be laid upon the one after",
                      "two images of the same bone from nearly the same pose",
                      "see that images and poses belong together and that the bone's outer contour is in the picture");
    }
    aligned.before_from_after = alignment->before_from_after;
    return aligned;
}

Result<Contour> outlineFromBefore(const CavityView& view, const TriangleMesh& mesh, const Silhouette& silhouette,
                                  const Rigid3& planned, const Rigid3& expected) {
    const Result<AlignedView> aligned = alignView(view, mesh, silhouette, planned, kMarginMm, 1);
    if (!aligned) return aligned.error();
    const Region& region = aligned->region;
    const auto expected_outline = predictedOutline(silhouette, view.carm, view.after_imager_from_femur * expected);
    const Image difference = differenceFrom(alignedBefore(aligned->log_before, region, aligned->before_from_after),
                                            aligned->log_after, region, aligned->mask);
    auto outline = expected_outline ? detectedOutline(difference, region, *expected_outline) : std::nullopt;
    if (!outline) {
        return failed(view, "no outline of a cavity in the difference of its images",
                      "a cavity near where it was planned that shows in the picture after the cut",
                      "see that the images before and after are not exchanged and that poses belong to them; take "
                      "pictures after the cut from nearer to the poses before it");
    }
    return *outline;
}

std::optional<Contour> outlineFromCt(const CavityView& view, const Rigid3& imager_from_femur, const VolumeProjector& ct,
                                     const TriangleMesh& mesh, const Silhouette& silhouette, const Rigid3& expected) {
    const CArm carm = view.carm.ideal();
    const auto region = regionOf(carm, mesh, imager_from_femur * expected, kMarginMm, 1);
    const auto outline = predictedOutline(silhouette, carm, imager_from_femur * expected);
    if (!region || !outline) return std::nullopt;
    const Mask mask = shadowMask(*region, *outline, kMaskMm / 2 * region->px_per_mm);
    Image reference = ct.project(carm.cropped(region->x, region->y, region->width, region->height), imager_from_femur);
    for (float& pixel : reference.pixels())
        pixel = -pixel;
    return detectedOutline(differenceFrom(reference, wholeLog(view.after, view.carm), *region, mask), *region,
                           *outline);
}

double contourResidual(const Contour& seen, const Silhouette& silhouette, const CArm& carm,
                       const Rigid3& imager_from_cavity) {
    const auto outline = predictedOutline(silhouette, carm, imager_from_cavity);
    return outline ? distanceTo(seen, *outline) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace fluorocut::cavity

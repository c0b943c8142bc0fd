#include "core/imaging/carm.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/option_checks.h"

namespace fluorocut {
namespace {

Vector2 pixelFromPlane(const CArm& carm, const Vector2& plane_mm) {
    return plane_mm.cwiseQuotient(carm.pixel_mm) + carm.principal_point_px;
}

Vector2 planeFromPixel(const CArm& carm, const Vector2& pixel) {
    return (pixel - carm.principal_point_px).cwiseProduct(carm.pixel_mm);
}

constexpr int kMaxPixels = 16384;

}  // namespace

Result<void> CArm::validate() const {
    return requireRanges({{"columns", static_cast<double>(columns), 1, kMaxPixels, "pixels"},
                          {"rows", static_cast<double>(rows), 1, kMaxPixels, "pixels"},
                          {"pixel_mm[0]", pixel_mm.x(), 1e-3, 100, "mm"},
                          {"pixel_mm[1]", pixel_mm.y(), 1e-3, 100, "mm"},
                          {"principal_point_px[0]", principal_point_px.x(), -1e6, 1e6, "pixels"},
                          {"principal_point_px[1]", principal_point_px.y(), -1e6, 1e6, "pixels"},
                          {"focal_length_mm", focal_length_mm, 10, 10000, "mm"}});
}

Vector2 CArm::projectIdeal(const Vector3& point_in_imager) const {
    if (!(point_in_imager.z() > 0)) return Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
    return pixelFromPlane(*this, focal_length_mm / point_in_imager.z() * point_in_imager.head<2>());
}

Vector2 CArm::project(const Vector3& point_in_imager) const {
    const Vector2 ideal_px = projectIdeal(point_in_imager);
    return distortion ? distortedPixel(ideal_px) : ideal_px;
}

Vector3 CArm::detectorPoint(const Vector2& pixel) const {
    Vector2 plane = planeFromPixel(*this, pixel);
    if (distortion) plane = distortion->undistorted(plane);
    return {plane.x(), plane.y(), focal_length_mm};
}

Vector2 CArm::idealPixel(const Vector2& distorted_px) const {
    if (!distortion) return distorted_px;
    return pixelFromPlane(*this, distortion->undistorted(planeFromPixel(*this, distorted_px)));
}

Vector2 CArm::distortedPixel(const Vector2& ideal_px) const {
    if (!distortion) return ideal_px;
    return pixelFromPlane(*this, distortion->distorted(planeFromPixel(*this, ideal_px)));
}

void CArm::idealRow(int y, std::span<Vector2> ideal_px) const {
    if (!distortion) {
        for (std::size_t x = 0; x < ideal_px.size(); ++x)
            ideal_px[x] = Vector2(static_cast<double>(x), y);
        return;
    }
    distortion->undistortedRow(planeFromPixel(*this, Vector2(0, y)), pixel_mm.x(), ideal_px);
    for (Vector2& pixel : ideal_px)
        pixel = pixelFromPlane(*this, pixel);
}

CArm CArm::ideal() const {
    CArm result = *this;
    result.distortion = nullptr;
    return result;
}

CArm CArm::binned(int factor) const {
    if (factor < 1 || columns < factor || rows < factor) throw std::logic_error("CArm::binned: bad factor");
    CArm result = *this;
    result.columns = columns / factor;
    result.rows = rows / factor;
    result.pixel_mm = pixel_mm * factor;
    result.principal_point_px = (principal_point_px.array() - 0.5 * (factor - 1)) / factor;
    return result;
}

CArm CArm::cropped(int x, int y, int width, int height) const {
    if (width < 1 || height < 1) throw std::logic_error("CArm::cropped: empty region");
    CArm result = *this;
    result.columns = width;
    result.rows = height;
    result.principal_point_px -= Vector2(x, y);
    return result;
}

}  // namespace fluorocut

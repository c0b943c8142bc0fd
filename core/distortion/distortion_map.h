// DistortionMap: what straightens the images of one imager in one pose: a model (distortion_model.h), the frame of the
// detector it is used in, and how good it is.
//
//     plate_mm    = model(pixel)                                   lattice of the grooved plate
//     detector_mm = detector_from_plate * plate_mm                 a turn and a shift in the plane
//     ideal_px    = middle + detector_mm / pixel_mm                middle = ((columns - 1) / 2, (rows - 1) / 2)
//
// The turn and the shift are chosen so that at the image's middle detector_mm is (0, 0) and the map does not turn the
// picture (the rotation closest to its Jacobian there is the identity): how the plate happened to lie does not matter.
// One square pixel_mm, by default the map's own scale in the middle, makes the straight image as large as the original.
//
// Support. The groove points vouch for the map inside their convex hull and half a pitch beyond: covers(). What a fit
// says farther out is no measurement, and a polynomial soon runs wild. So from the rim of the support on the map is
// continued along straight lines from the middle of the support,
//
//     f(p) = f(q) + J(q) (p - q),      q: the point of the rim toward p
//
// which is smooth and one-to-one on the whole plane: pixelFromDetector and the projectors never fail. detectorFromPixel
// and plateFromPixel are this continued map. Where the model itself has no answer inside the support (the paper's
// between lost grooves) a smooth surface through the neighbourhood stands in; covers() is false there.
//
// Files: fluorocut/distortion/1
//     {"schema": "fluorocut/distortion/1", "model": "polynomial", "columns": 512, "rows": 512, "pixel_mm": 0.3204,
//      "pitch_mm": 6.35, "detector_from_plate": {"rotation_rad": 0.013, "shift_mm": [-0.41, 1.02]},
//      "support": {"centre_px": [255.1, 255.8], "radius_px": [241.5, ...]},
//      "quality": {"rms_px": 0.1, "rms_mm": 0.03, "points_used": 1302, "points_rejected": 17, "columns_found": 26,
//                  "rows_found": 26, "coverage": 0.78, "warnings": []},
//      "position": {"orbital_deg": 30, "angulation_deg": 0}, "measured_at": "2026-03-01T09:30:00Z",
//      "parameters": {"order": [5], ...}}
// `radius_px`: the rim of the support at equal angles from +u toward +v. `position` and `measured_at` (UTC) may be
// null; so may figures of `quality` that nobody knows. `parameters` are the model's own, arrays of numbers. What is
// read is what was written, to the last bit.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/distortion/distortion_model.h"
#include "core/distortion/support.h"
#include "core/imaging/carm_file.h"
#include "core/imaging/carm_position.h"

namespace fluorocut {

// A turn and a shift in the plane.
struct PlaneMotion {
    double rotation_rad = 0;
    Vector2 shift_mm = Vector2::Zero();

    Matrix2 rotation() const { return Eigen::Rotation2Dd(rotation_rad).toRotationMatrix(); }
    Vector2 operator*(const Vector2& point) const { return rotation() * point + shift_mm; }
};

struct DistortionQuality {
    double rms_px = std::numeric_limits<double>::quiet_NaN();  // residuals of the points used, across their grooves
    double rms_mm = std::numeric_limits<double>::quiet_NaN();
    int points_used = 0;
    int points_rejected = 0;
    int columns_found = 0;  // grooves along y with points in use
    int rows_found = 0;
    double coverage = std::numeric_limits<double>::quiet_NaN();  // share of the image inside the support
    std::vector<std::string> warnings;
};

struct DistortionMapParts {
    std::shared_ptr<const DistortionModel> model;
    int columns = 0;
    int rows = 0;
    double pixel_mm = 0;
    double pitch_mm = 0;
    PlaneMotion detector_from_plate;
    Support support;
    DistortionQuality quality;
    std::optional<CArmPosition> position;  // where the C-arm stood; its isocentre plays no part
    std::string measured_at;               // "2026-03-01T09:30:00Z", empty when unknown
};

class DistortionMap {
  public:
    // noSolution when the model answers hardly anywhere. Throws std::logic_error when there is no model, no support or
    // no scale.
    static Result<DistortionMap> create(DistortionMapParts parts);
    // For parts that are known to be good (another map's): throws std::logic_error otherwise.
    explicit DistortionMap(DistortionMapParts parts) : DistortionMap(create(std::move(parts)).value()) {}

    // The same map, measured with the C-arm there and then.
    DistortionMap measured(std::optional<CArmPosition> position, std::string measured_at) const;

    const DistortionMapParts& parts() const { return parts_; }
    const DistortionModel& model() const { return *parts_.model; }
    int columns() const { return parts_.columns; }
    int rows() const { return parts_.rows; }
    double pixelMm() const { return parts_.pixel_mm; }
    Vector2 middle() const { return 0.5 * Vector2(parts_.columns - 1, parts_.rows - 1); }
    const DistortionQuality& quality() const { return parts_.quality; }
    // The model, or the smooth surface that stands in for one with holes: answers everywhere, in plate mm.
    const DistortionModel& smoothModel() const { return fallback_ ? *fallback_ : *parts_.model; }

    // Supported by points: see above. With a margin, out to so many pixels beyond the rim (less than 0: inside it).
    bool covers(const Vector2& pixel, double margin_px = 0) const;

    Vector2 plateFromPixel(const Vector2& pixel) const;
    Vector2 detectorFromPixel(const Vector2& pixel) const;
    Matrix2 detectorJacobian(const Vector2& pixel) const;  // mm per pixel; beyond the rim that of the rim
    // mm^2, along the detector's axes: the model's. Beyond the rim that of the rim, which is too small there.
    Matrix2 covariance(const Vector2& pixel) const;
    // Inverse of detectorFromPixel to 1e-9 mm: Newton's method. NaN for NaN.
    Vector2 pixelFromDetector(const Vector2& detector_mm) const;
    // The same from a guess, only to tolerance_mm.
    Vector2 pixelFromDetector(const Vector2& detector_mm, const Vector2& guess_px, double tolerance_mm) const;

    Vector2 idealPixel(const Vector2& pixel) const;         // straight from distorted
    Vector2 distortedPixel(const Vector2& ideal_px) const;  // distorted from straight
    // detector_mm[i] = detectorFromPixel(first + i * (step, 0)): rows of pixels, quickly.
    void detectorRow(const Vector2& first, double step, std::span<Vector2> detector_mm) const;

  private:
    DistortionMap() = default;
    friend Result<DistortionMap> fitDistortion(const GroovePoints&, const DistortionFitOptions&, Progress&);
    void placeDetector(double pixel_mm);

    struct Linear {
        Vector2 detector_mm;
        Matrix2 jacobian;
    };
    Linear linearised(const Vector2& pixel) const;

    DistortionMapParts parts_;
    std::shared_ptr<const DistortionModel> fallback_;  // answers everywhere; null when the model itself does
    Matrix2 rotation_;
};

// Fits options.model to the points. noSolution, in words, when they do not carry it.
Result<DistortionMap> fitDistortion(const GroovePoints& points, const DistortionFitOptions& options,
                                    Progress& progress = Progress::none());

// The share of the image's pixels that the map covers.
double coverage(const DistortionMap& map);

// How far each point of a groove lies from where the map has its groove (along_y: in x; along_x: in y), plate mm.
struct GrooveResiduals {
    std::vector<double> along_y_mm, along_x_mm;
};
GrooveResiduals grooveResiduals(const DistortionMap& map, const GroovePoints& points);

Result<DistortionMap> readDistortionMap(const std::filesystem::path& path);
Result<void> writeDistortionMap(const std::filesystem::path& path, const DistortionMap& map);

// The map as a C-arm's distortion. Its mm are counted from the C-arm's principal point c with its pixels p:
// undistorted = detector_mm(pixel) - (c - middle) p, so that CArm::idealPixel(pixel) = middle + detector_mm / p for any
// c. invalidInput when the sizes differ or the C-arm's pixel is more than 10 % off the map's.
Result<std::shared_ptr<const Distortion>> distortionOf(const DistortionMap& map, const CArm& carm);

// The map behind a distortion that distortionOf made; null for any other.
const DistortionMap* mapOf(const Distortion& distortion);

// For readCArm.
DistortionReaders distortionReaders();

}  // namespace fluorocut

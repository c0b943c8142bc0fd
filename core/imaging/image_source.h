// ImageSource: whatever hands over fluoroscopic images: a C-arm, a frame grabber, a watched folder, a file, the virtual
// operating room. With each image comes what is known of it, and only that: what nobody measured stays empty, and a
// nominal value is never passed off as a calibrated one.
//
// To write a new one:
//  1. one file pair `<what>_image_source.{h,cpp}`, here, or in core/simulation when it simulates;
//  2. derive from ImageSource; say in `capabilities` what requests it can fulfil;
//  3. `acquire` checks the request (checkRequest does it), reports to `progress`, asks it about cancellation at least
//     every 100 ms, and returns an Error for whatever goes wrong outside our code: no exception leaves it;
//  4. bright means more photons: turn the picture when the device says the opposite;
//  5. add it to the list in tests/core/simulation/image_source_contract_test.cpp: every rule above is tested there.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"
#include "core/imaging/carm_position.h"
#include "core/io/image_file.h"

namespace fluorocut {

struct ImageSourceCapabilities {
    bool moves = false;       // drives the C-arm to `ImageRequest::position`
    int frames = 1;           // frames that can be asked for by number; 0: live, the number is ignored
    bool repeatable = false;  // the same request gives the same picture (a file), not a new exposure
};

struct ImageRequest {
    std::optional<CArmPosition> position;  // where the C-arm shall stand; empty: where it stands
    int frame = 1;                         // of a multi-frame file, counted from 1
};

struct PixelSpacing {
    Vector2 mm = Vector2::Ones();  // along columns (x), along rows (y)
    SpacingPlane plane = SpacingPlane::unstated;
};

struct ExposureInfo {
    std::optional<double> tube_voltage_kv;
    std::optional<double> tube_current_ma;
    std::optional<double> exposure_time_ms;
};

struct ImageProvenance {
    std::string source;                 // the source's name
    std::string identity;               // what tells this picture from all others: path and frame, instance UID, number
    std::uint64_t sequence = 0;         // acquisitions of this source before this one
    std::vector<std::string> warnings;  // what the reader or device had to assume
};

struct AcquiredImage {
    Image image;
    std::optional<CArm> nominal_carm;  // the maker's or configured model of the C-arm: not a calibration
    std::optional<PixelSpacing> pixel_spacing;
    std::optional<double> source_detector_mm;  // as reported
    std::optional<CArmPosition> nominal_position;
    std::optional<std::chrono::system_clock::time_point> time;  // of the exposure
    ExposureInfo exposure;
    ImageProvenance provenance;
};

class ImageSource {
  public:
    virtual ~ImageSource() = default;

    virtual std::string name() const = 0;
    virtual ImageSourceCapabilities capabilities() const = 0;
    virtual Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) = 0;
};

// Refuses what the source cannot do: a position when it cannot move, a frame that it does not have.
Result<void> checkRequest(const ImageSource& source, const ImageRequest& request);

}  // namespace fluorocut

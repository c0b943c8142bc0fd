#include "core/imaging/file_image_source.h"

#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {

AcquiredImage acquiredFrom(ImageFile file, const std::filesystem::path& path) {
    const ImageInfo& info = file.info;
    AcquiredImage acquired;
    acquired.image = std::move(file.image);
    if (info.imager_pixel_spacing_mm) {
        acquired.pixel_spacing = PixelSpacing{*info.imager_pixel_spacing_mm, SpacingPlane::detector};
    } else if (info.pixel_spacing_mm) {
        acquired.pixel_spacing = PixelSpacing{*info.pixel_spacing_mm, info.spacing_plane};
    }
    acquired.source_detector_mm = info.source_detector_mm;
    if (info.primary_angle_deg && info.secondary_angle_deg) {
        acquired.nominal_position = CArmPosition{radiansFromDegrees(*info.primary_angle_deg),
                                                 radiansFromDegrees(*info.secondary_angle_deg), Vector3::Zero()};
    }
    acquired.provenance.identity =
        info.frames > 1 ? fmt::format("{}, frame {}", path.string(), info.frame) : path.string();
    acquired.provenance.warnings = info.notes;
    return acquired;
}

Result<FileImageSource> FileImageSource::open(const std::filesystem::path& path) {
    const auto file = readImage(path);
    if (!file) return file.error();
    return FileImageSource(path, file->info.frames);
}

ImageSourceCapabilities FileImageSource::capabilities() const {
    ImageSourceCapabilities can;
    can.frames = frames_;
    can.repeatable = true;
    return can;
}

Result<AcquiredImage> FileImageSource::acquire(const ImageRequest& request, Progress& progress) {
    if (auto ok = checkRequest(*this, request); !ok) return ok.error();
    if (progress.isCancelled()) return cancelled(name());
    progress.report(0, "reading");
    auto file = readImage(path_, {request.frame});
    if (!file) return file.error();

    AcquiredImage acquired = acquiredFrom(std::move(*file), path_);
    acquired.provenance.source = name();
    acquired.provenance.sequence = acquired_++;
    progress.report(1, "read");
    return acquired;
}

}  // namespace fluorocut

// An image file as an ImageSource: any format of core/io/image_file.h. The frames of a multi-frame file are asked for
// by their number. What the file states (pixel size and its plane, distances, positioner angles) comes along; a model
// of the C-arm does not, since no file states one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "core/imaging/image_source.h"

namespace fluorocut {

// What a file says, as a source hands it over; but for the provenance's source and sequence.
AcquiredImage acquiredFrom(ImageFile file, const std::filesystem::path& path);

class FileImageSource final : public ImageSource {
  public:
    // Reads the first frame, so that what is wrong with the file is said at once.
    static Result<FileImageSource> open(const std::filesystem::path& path);

    std::string name() const override { return path_.string(); }
    ImageSourceCapabilities capabilities() const override;
    Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) override;

  private:
    FileImageSource(std::filesystem::path path, int frames) : path_(std::move(path)), frames_(frames) {}

    std::filesystem::path path_;
    int frames_;
    std::uint64_t acquired_ = 0;
};

}  // namespace fluorocut

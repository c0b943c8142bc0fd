#include "core/io/formats/pixels.h"

#include <fmt/format.h>

#include "core/io/formats/byte_reader.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

Result<void> checkFrame(const std::filesystem::path& path, int frame, int frames) {
    if (frame >= 1 && frame <= frames) return {};
    return invalidInput(path.string(), fmt::format("{} frame{}", frames, frames == 1 ? "" : "s"),
                        fmt::format("a frame {}", frame),
                        frames == 1 ? "ask for frame 1" : fmt::format("ask for a frame from 1 to {}", frames));
}

Result<void> checkImageSize(const std::filesystem::path& path, std::uint64_t width, std::uint64_t height,
                            double bytes_per_pixel, double ratio) {
    constexpr auto kMost = static_cast<std::uint64_t>(kMaxAxis);
    const std::string sizes = fmt::format("{} x {} pixels", width, height);
    if (!(width >= 1 && height >= 1 && width <= kMost && height <= kMost && width * height <= kMaxImagePixels)) {
        return invalidInput(path.string(), sizes, fmt::format("1 to {} pixels in all", kMaxImagePixels));
    }
    const Result<std::uint64_t> size = inputFileSize(path);
    if (!size) return size.error();
    const double least = static_cast<double>(width * height) * bytes_per_pixel / ratio;
    if (least > static_cast<double>(*size) + 4096) {
        return invalidInput(path.string(), fmt::format("{} declared by a file of {} bytes", sizes, *size),
                            "all of the pixels", "the file is cut short or its header is wrong; export it again");
    }
    return {};
}

std::vector<float> luminance(const std::vector<float>& samples, std::size_t channels, std::vector<std::string>& notes) {
    std::vector<float> grey(samples.size() / channels);
    bool colour = false;
    for (std::size_t i = 0; i < grey.size(); ++i) {
        const float* s = samples.data() + i * channels;
        const bool equal = s[0] == s[1] && s[1] == s[2];
        colour = colour || !equal;
        grey[i] = equal ? s[0] : 0.2126f * s[0] + 0.7152f * s[1] + 0.0722f * s[2];  // Rec. 709
    }
    if (colour) notes.push_back("colour was turned into luminance: an X-ray image has none");
    return grey;
}

void mirrorValues(std::vector<float>& values, double least, double most) {
    const double sum = least + most;
    for (float& value : values)
        value = static_cast<float>(sum - static_cast<double>(value));
}

}  // namespace fluorocut

// DICOM's RLE (PS3.5 annex G): a header of 16 numbers (segments, then where each begins), then one PackBits segment for
// every byte of every sample, most significant byte first. Our own, because DCMTK 3.6.7 crashes on damaged ones.
#include <cstring>

#include "core/io/formats/dicom_file.h"

namespace fluorocut {

namespace {

constexpr std::size_t kHeader = 64;

std::uint32_t headerWord(const std::vector<std::uint8_t>& bytes, std::size_t index) {
    const std::uint8_t* p = bytes.data() + 4 * index;
    return std::uint32_t{p[3]} << 24 | std::uint32_t{p[2]} << 16 | std::uint32_t{p[1]} << 8 | p[0];
}

// Every `stride`-th byte of `to`, `count` of them, from the PackBits between `from` and `end`.
bool unpack(const std::uint8_t* from, const std::uint8_t* end, std::uint8_t* to, std::size_t count,
            std::size_t stride) {
    std::size_t done = 0;
    while (done < count) {
        if (from >= end) return false;
        const int code = static_cast<std::int8_t>(*from++);
        if (code == -128) continue;
        const std::size_t run = static_cast<std::size_t>(code >= 0 ? code + 1 : 1 - code);
        const std::size_t taken = code >= 0 ? run : 1;
        if (static_cast<std::size_t>(end - from) < taken) return false;
        for (std::size_t i = 0; i < run && done < count; ++i, ++done)
            to[done * stride] = from[code >= 0 ? i : 0];
        from += taken;
    }
    return true;
}

}  // namespace

bool decodeRle(const std::vector<std::uint8_t>& bytes, std::size_t pixels, std::size_t samples,
               std::size_t bytes_per_sample, std::vector<std::uint8_t>& values) {
    if (bytes.size() < kHeader) return false;
    const std::size_t segments = samples * bytes_per_sample;
    if (segments > 15 || headerWord(bytes, 0) != segments) return false;
    values.assign(pixels * segments, 0);
    for (std::size_t segment = 0; segment < segments; ++segment) {
        const std::size_t begin = headerWord(bytes, 1 + segment);
        const std::size_t end = segment + 1 < segments ? headerWord(bytes, 2 + segment) : bytes.size();
        if (begin < kHeader || end > bytes.size() || begin > end) return false;
        // segment 0 is the first sample's most significant byte; values are interleaved and little-endian
        const std::size_t sample = segment / bytes_per_sample;
        const std::size_t byte = bytes_per_sample - 1 - segment % bytes_per_sample;
        if (!unpack(bytes.data() + begin, bytes.data() + end, values.data() + sample * bytes_per_sample + byte, pixels,
                    segments)) {
            return false;
        }
    }
    return true;
}

}  // namespace fluorocut

#include "core/io/formats/raster.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

#include "core/io/formats/byte_reader.h"

namespace fluorocut {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "elements are converted from and to little endian");

std::size_t byteCount(ElementType type) {
    switch (type) {
        case ElementType::uint8:
        case ElementType::int8:
            return 1;
        case ElementType::uint16:
        case ElementType::int16:
            return 2;
        case ElementType::uint32:
        case ElementType::int32:
        case ElementType::float32:
            return 4;
        case ElementType::uint64:
        case ElementType::int64:
        case ElementType::float64:
            return 8;
    }
    throw std::logic_error("ElementType outside its enumeration");
}

bool isFloating(ElementType type) {
    return type == ElementType::float32 || type == ElementType::float64;
}

bool isSigned(ElementType type) {
    return type == ElementType::int8 || type == ElementType::int16 || type == ElementType::int32 ||
           type == ElementType::int64 || isFloating(type);
}

std::string_view trimmed(std::string_view text) {
    const auto begin = text.find_first_not_of(" \t\r\n");
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1);
}

std::vector<std::string_view> words(std::string_view text, std::string_view separators) {
    std::vector<std::string_view> result;
    std::size_t at = 0;
    while ((at = text.find_first_not_of(separators, at)) != std::string_view::npos) {
        const std::size_t end = std::min(text.find_first_of(separators, at), text.size());
        result.push_back(text.substr(at, end - at));
        at = end;
    }
    return result;
}

bool parseNumber(std::string_view text, double& value) {
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    return code == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

bool parseInteger(std::string_view text, std::int64_t& value) {
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    return code == std::errc() && end == text.data() + text.size();
}

std::string lower(std::string_view text) {
    std::string result(text);
    std::transform(result.begin(), result.end(), result.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return result;
}

std::string printable(std::string_view text) {
    std::string result;
    for (const char c : text.substr(0, 60))
        result += std::isprint(static_cast<unsigned char>(c)) ? c : '?';
    return text.size() > 60 ? result + "..." : result;
}

std::string shown(std::string_view text) {
    return fmt::format("\"{}\"", printable(text));
}

Result<void> checkRaster(const fs::path& path, RasterHeader& header, std::uint64_t max_elements) {
    const std::string where = path.string();
    std::uint64_t count = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!(header.size[axis] >= 1 && header.size[axis] <= kMaxAxis)) {
            return invalidInput(fmt::format("{}, size of axis {}", where, axis), fmt::format("{}", header.size[axis]),
                                fmt::format("1 to {}", kMaxAxis));
        }
        count *= static_cast<std::uint64_t>(header.size[axis]);  // below 2^51: no overflow
    }
    const std::string sizes = fmt::format("{} elements", fmt::join(header.size, " x "));
    if (count > max_elements) return invalidInput(where, sizes, fmt::format("at most {} elements", max_elements));
    for (int axis = 0; axis < header.dimensions; ++axis) {
        if (!(header.spacing_mm[axis] >= 1e-4 && header.spacing_mm[axis] <= 1e4)) {
            return invalidInput(fmt::format("{}, spacing of axis {}", where, axis),
                                fmt::format("{} mm", header.spacing_mm[axis]), "0.0001 to 10000 mm",
                                "export it again with its spacing");
        }
        if (!(std::abs(header.origin_mm[axis]) <= 1e6)) {
            return invalidInput(fmt::format("{}, origin of axis {}", where, axis),
                                fmt::format("{} mm", header.origin_mm[axis]), "a finite origin below 1000 m");
        }
    }
    const double skewness =
        (header.direction.transpose() * header.direction - Matrix3::Identity()).cwiseAbs().maxCoeff();
    if (!(skewness <= 1e-3)) {
        return invalidInput(where + ", axis directions", fmt::format("directions off orthonormal by {:.3g}", skewness),
                            "orthonormal directions within 0.001", "resample a sheared volume to a regular grid first");
    }
    // Directions are written with few digits; what the rest of the program gets is orthonormal to the last.
    for (int axis = 0; axis < 3; ++axis) {
        Vector3 column = header.direction.col(axis);
        for (int before = 0; before < axis; ++before) {
            column -= column.dot(header.direction.col(before)) * header.direction.col(before);
        }
        // an axis parallel to the frame's is left as it is, bit for bit
        header.direction.col(axis) = std::abs(column.squaredNorm() - 1) < 1e-15 ? column : column.normalized();
    }
    if (!(std::isfinite(header.slope) && std::isfinite(header.intercept))) {
        return invalidInput(where + ", rescale", fmt::format("slope {}, intercept {}", header.slope, header.intercept),
                            "finite numbers");
    }
    const Result<std::uint64_t> file_size = inputFileSize(header.data_file);
    if (!file_size) {
        Error error = file_size.error();
        if (header.data_file != path)
            error.where = fmt::format("{}, its data file {}", where, shown(header.data_file.filename().string()));
        return error;
    }
    const std::uint64_t held = *file_size > header.data_offset ? *file_size - header.data_offset : 0;
    const std::uint64_t wanted = count * byteCount(header.type);
    if (header.compressed ? wanted / kMaxInflation > held : wanted > held) {
        return invalidInput(where,
                            fmt::format("{} bytes of {}data for {} ({} bytes)", held,
                                        header.compressed ? "compressed " : "", sizes, wanted),
                            "all of the data", "the file is cut short or its header is wrong; copy or export it again");
    }
    return {};
}

namespace {

template <class T>
void convert(const unsigned char* from, std::size_t count, bool swap, double slope, double intercept,
             std::vector<float>& to) {
    const bool plain = slope == 1 && intercept == 0;
    for (std::size_t i = 0; i < count; ++i) {
        unsigned char bytes[sizeof(T)];
        std::memcpy(bytes, from + i * sizeof(T), sizeof(T));
        if (swap) std::reverse(bytes, bytes + sizeof(T));
        T value;
        std::memcpy(&value, bytes, sizeof(T));
        to.push_back(plain ? static_cast<float>(value)
                           : static_cast<float>(slope * static_cast<double>(value) + intercept));
    }
}

void convert(const RasterHeader& header, const unsigned char* from, std::size_t count, std::vector<float>& to) {
    const auto run = [&](auto type) {
        convert<decltype(type)>(from, count, header.big_endian, header.slope, header.intercept, to);
    };
    switch (header.type) {
        case ElementType::uint8:
            return run(std::uint8_t{});
        case ElementType::int8:
            return run(std::int8_t{});
        case ElementType::uint16:
            return run(std::uint16_t{});
        case ElementType::int16:
            return run(std::int16_t{});
        case ElementType::uint32:
            return run(std::uint32_t{});
        case ElementType::int32:
            return run(std::int32_t{});
        case ElementType::uint64:
            return run(std::uint64_t{});
        case ElementType::int64:
            return run(std::int64_t{});
        case ElementType::float32:
            return run(float{});
        case ElementType::float64:
            return run(double{});
    }
}

}  // namespace

Result<std::vector<float>> readRaster(const fs::path& path, const RasterHeader& header, std::uint64_t first,
                                      std::uint64_t count, Progress& progress) {
    const std::size_t bytes = byteCount(header.type);
    Result<ByteReader> reader =
        ByteReader::open(header.data_file, header.data_offset,
                         header.compressed ? ByteReader::Encoding::deflate : ByteReader::Encoding::raw);
    if (!reader) return reader.error();
    const auto cutShort = [&](std::uint64_t got) {
        return invalidInput(path.string(), fmt::format("{} after {} of {} elements", reader->problem(), got, count),
                            "all of the data", "the file is damaged; copy or export it again");
    };
    const std::uint64_t before = header.inflated_skip + first * bytes;
    if (before > 0 && !reader->skip(before)) return cutShort(0);
    std::vector<float> values;
    values.reserve(static_cast<std::size_t>(count));  // address space only: pages are touched as data arrives
    constexpr std::size_t kPiece = 1 << 18;
    std::vector<unsigned char> buffer(std::min<std::uint64_t>(count, kPiece) * bytes);
    while (values.size() < count) {
        if (progress.isCancelled()) return cancelled("reading " + path.string());
        const std::size_t piece = static_cast<std::size_t>(std::min<std::uint64_t>(count - values.size(), kPiece));
        if (reader->read(buffer.data(), piece * bytes) < piece * bytes) return cutShort(values.size());
        convert(header, buffer.data(), piece, values);
        progress.report(static_cast<double>(values.size()) / static_cast<double>(count), "reading");
    }
    if (first + count == header.count() && !reader->endsWell()) {
        return invalidInput(path.string(), "compressed data whose end or check sum is wrong", "undamaged data",
                            "copy or export it again");
    }
    return values;
}

Result<std::string> encodeElements(const fs::path& path, const std::vector<float>& values, ElementType type) {
    if (type == ElementType::float32) {
        return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    }
    double least = 0, most = 0;
    switch (type) {
        case ElementType::uint8:
            most = 255;
            break;
        case ElementType::uint16:
            most = 65535;
            break;
        case ElementType::int16:
            least = -32768;
            most = 32767;
            break;
        default:
            throw std::logic_error("encodeElements: a type that no writer uses");
    }
    std::string bytes(values.size() * byteCount(type), '\0');
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double value = std::nearbyint(static_cast<double>(values[i]));
        if (!(value >= least && value <= most)) {
            return invalidOption(path.string(), fmt::format("the value {}", values[i]),
                                 fmt::format("values from {} to {}", least, most),
                                 "write float, or give the range of values to be mapped");
        }
        const std::uint16_t element = static_cast<std::uint16_t>(static_cast<std::int32_t>(value));
        std::memcpy(bytes.data() + i * byteCount(type), &element, byteCount(type));
    }
    return bytes;
}

}  // namespace fluorocut

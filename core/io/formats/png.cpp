// PNG through libpng: 1 to 16 bits, grey, palette or colour (as luminance); transparency is ignored.
//
// libpng reports errors by longjmp. The functions that call it between setjmp and longjmp therefore hold no object with
// a destructor of their own: those live in the callers.
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <png.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/pixels.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

struct Png {
    std::FILE* file = nullptr;
    png_structp png = nullptr;
    png_infop info = nullptr;
    bool writing = false;
    char problem[128] = "";
    png_uint_32 width = 0, height = 0;
    int stored_bits = 0, bits = 0, colour_type = 0, channels = 0;

    Png() = default;
    Png(const Png&) = delete;
    Png& operator=(const Png&) = delete;
    ~Png() {
        if (png && writing) png_destroy_write_struct(&png, &info);
        if (png && !writing) png_destroy_read_struct(&png, &info, nullptr);
        if (file) std::fclose(file);
    }
};

[[noreturn]] void onError(png_structp png, png_const_charp message) {
    std::snprintf(static_cast<Png*>(png_get_error_ptr(png))->problem, sizeof Png{}.problem, "%s", message);
    png_longjmp(png, 1);
}

void onWarning(png_structp, png_const_charp) {}  // libpng would print it

// Everything up to the first row.
bool readHeader(Png& state) {
    state.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &state, onError, onWarning);
    if (!state.png) return false;
    if (setjmp(png_jmpbuf(state.png))) return false;
    state.info = png_create_info_struct(state.png);
    if (!state.info) return false;
    png_set_user_limits(state.png, static_cast<png_uint_32>(kMaxAxis), static_cast<png_uint_32>(kMaxAxis));
    png_init_io(state.png, state.file);
    png_read_info(state.png, state.info);
    png_get_IHDR(state.png, state.info, &state.width, &state.height, &state.stored_bits, &state.colour_type, nullptr,
                 nullptr, nullptr);
    png_set_expand(state.png);  // palette to RGB, 1/2/4 bits to 8
    png_set_strip_alpha(state.png);
    png_set_swap(state.png);  // 16 bits are big-endian in the file
    png_set_interlace_handling(state.png);
    png_read_update_info(state.png, state.info);
    state.bits = png_get_bit_depth(state.png, state.info);
    state.channels = png_get_channels(state.png, state.info);
    return true;
}

bool readRows(Png& state, png_bytepp rows) {
    if (setjmp(png_jmpbuf(state.png))) return false;
    png_read_image(state.png, rows);
    png_read_end(state.png, nullptr);
    return true;
}

bool writeRows(Png& state, png_bytepp rows) {
    state.writing = true;
    state.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &state, onError, onWarning);
    if (!state.png) return false;
    if (setjmp(png_jmpbuf(state.png))) return false;
    state.info = png_create_info_struct(state.png);
    if (!state.info) return false;
    png_init_io(state.png, state.file);
    png_set_IHDR(state.png, state.info, state.width, state.height, state.bits, state.colour_type, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(state.png, state.info);
    png_set_swap(state.png);
    png_write_image(state.png, rows);
    png_write_end(state.png, nullptr);
    return true;
}

std::vector<png_bytep> rowPointers(std::string& bytes, std::size_t rows) {
    std::vector<png_bytep> pointers(rows);
    const std::size_t stride = bytes.size() / rows;
    for (std::size_t y = 0; y < rows; ++y)
        pointers[y] = reinterpret_cast<png_bytep>(bytes.data() + y * stride);
    return pointers;
}

}  // namespace

Result<ImageFile> readPng(const fs::path& path, const ImageReadOptions& options) {
    if (const Result<std::uint64_t> size = inputFileSize(path); !size) return size.error();
    if (Result<void> frame = checkFrame(path, options.frame, 1); !frame) return frame.error();
    Png state;
    state.file = std::fopen(path.c_str(), "rb");
    const auto broken = [&] {
        return invalidInput(path.string(), fmt::format("a damaged PNG file ({})", state.problem), "an undamaged file",
                            "copy or export it again");
    };
    if (!state.file || !readHeader(state)) return broken();
    const double stored_bytes = state.stored_bits * png_get_channels(state.png, state.info) / 8.0;
    if (Result<void> size = checkImageSize(
            path, state.width, state.height,
            state.colour_type == PNG_COLOR_TYPE_PALETTE ? state.stored_bits / 8.0 : stored_bytes, kMaxInflation);
        !size) {
        return size.error();
    }
    const std::size_t channels = static_cast<std::size_t>(state.channels);
    const std::size_t sample_bytes = state.bits == 16 ? 2 : 1;
    const std::size_t count = std::size_t{state.width} * state.height * channels;
    std::string bytes(count * sample_bytes, '\0');
    std::vector<png_bytep> rows = rowPointers(bytes, state.height);
    if (!readRows(state, rows.data())) return broken();

    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) {
        std::uint16_t value = 0;
        std::memcpy(&value, bytes.data() + i * sample_bytes, sample_bytes);
        values[i] = value;
    }
    ImageFile result;
    result.info.format = "PNG";
    result.info.bits = state.bits;
    if (state.stored_bits < 8 && state.colour_type == PNG_COLOR_TYPE_GRAY) {
        result.info.notes.push_back(fmt::format("{} bits were stretched to 8", state.stored_bits));
    }
    if (channels >= 3) values = luminance(values, channels, result.info.notes);
    result.image = Image(static_cast<int>(state.width), static_cast<int>(state.height), std::move(values));
    return result;
}

namespace {

Result<void> writeBytes(const fs::path& path, std::string bytes, int width, int height, int bits, int colour_type) {
    return writeWhole(path, [&](const fs::path& temporary) -> Result<void> {
        Png state;
        state.width = static_cast<png_uint_32>(width);
        state.height = static_cast<png_uint_32>(height);
        state.bits = bits;
        state.colour_type = colour_type;
        state.file = std::fopen(temporary.c_str(), "wb");
        std::vector<png_bytep> rows = rowPointers(bytes, state.height);
        if (!state.file || !writeRows(state, rows.data()) || std::fflush(state.file) != 0) {
            return outputFailed(path.string(), fmt::format("not all of it could be written {}", state.problem),
                                "free some space");
        }
        return {};
    });
}

}  // namespace

Result<void> writePng(const fs::path& path, const Image& image, PixelType type) {
    const bool wide = type == PixelType::uint16;
    Result<std::string> bytes = encodeElements(path, image.pixels(), wide ? ElementType::uint16 : ElementType::uint8);
    if (!bytes) return bytes.error();
    return writeBytes(path, std::move(*bytes), image.width(), image.height(), wide ? 16 : 8, PNG_COLOR_TYPE_GRAY);
}

Result<void> writePng(const fs::path& path, const ColorImage& figure) {
    std::string bytes(3 * figure.size(), '\0');
    std::memcpy(bytes.data(), figure.pixels().data(), bytes.size());
    return writeBytes(path, std::move(bytes), figure.width(), figure.height(), 8, PNG_COLOR_TYPE_RGB);
}

}  // namespace fluorocut

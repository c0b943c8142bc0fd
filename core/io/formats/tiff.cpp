// TIFF through libtiff: 8, 16, 32-bit integers and floats, grey or colour (as luminance), strips or tiles, stacks of
// pages. Uncompressed, LZW, Deflate and PackBits only: they are what measurements are stored in, and the other decoders
// are where libtiff's holes have been.
#include <cstring>
#include <memory>
#include <mutex>

#include <fmt/format.h>
#include <tiffio.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/pixels.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

thread_local std::string last_problem;

// libtiff prints its messages; ours keeps the first of them. The handlers are the process's, so they are set once.
void keepProblem(const char*, const char* format, va_list arguments) {
    char text[256];
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    std::vsnprintf(text, sizeof text, format, arguments);
#pragma GCC diagnostic pop
    if (last_problem.empty()) last_problem = text;
}

struct CloseTiff {
    void operator()(TIFF* file) const { TIFFClose(file); }
};
using Tiff = std::unique_ptr<TIFF, CloseTiff>;

Tiff openTiff(const fs::path& path, const char* mode) {
    static std::once_flag once;
    std::call_once(once, [] {
        TIFFSetErrorHandler(keepProblem);
        TIFFSetWarningHandler(nullptr);
    });
    last_problem.clear();
    return Tiff(TIFFOpen(path.c_str(), mode));
}

Error damaged(const fs::path& path) {
    return invalidInput(path.string(),
                        fmt::format("a damaged TIFF file{}", last_problem.empty() ? "" : " (" + last_problem + ")"),
                        "an undamaged file", "copy or export it again");
}

// The page that libtiff stands at.
struct Page {
    std::uint32_t width = 0, height = 0;
    std::uint16_t bits = 1, channels = 1, format = SAMPLEFORMAT_UINT, photometric = PHOTOMETRIC_MINISBLACK;
    std::uint16_t planar = PLANARCONFIG_CONTIG, compression = COMPRESSION_NONE;

    std::size_t sampleBytes() const { return bits / 8u; }
    bool sameAs(const Page& o) const {
        return width == o.width && height == o.height && bits == o.bits && channels == o.channels && format == o.format;
    }
};

Result<Page> readPageHeader(const fs::path& path, TIFF* tiff) {
    Page page;
    TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &page.width);
    TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &page.height);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &page.bits);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &page.channels);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &page.format);
    TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &page.photometric);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &page.planar);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &page.compression);
    const auto unsupported = [&](std::string found, std::string expected) {
        return invalidInput(path.string(), std::move(found), std::move(expected), "save it as greyscale TIFF");
    };
    // At best 4095 bytes from a 12-bit LZW code; the other three do less.
    constexpr double kBestRatio = 2730;
    switch (page.compression) {
        case COMPRESSION_NONE:
        case COMPRESSION_LZW:
        case COMPRESSION_DEFLATE:
        case COMPRESSION_ADOBE_DEFLATE:
        case COMPRESSION_PACKBITS:
            break;
        default:
            return unsupported(fmt::format("TIFF compression {}", page.compression), "none, LZW, Deflate or PackBits");
    }
    const bool floating = page.format == SAMPLEFORMAT_IEEEFP;
    const bool whole = page.format == SAMPLEFORMAT_UINT || page.format == SAMPLEFORMAT_INT;
    if (!((whole && (page.bits == 8 || page.bits == 16 || page.bits == 32)) ||
          (floating && (page.bits == 32 || page.bits == 64)))) {
        return unsupported(fmt::format("{}-bit samples of format {}", page.bits, page.format),
                           "8, 16 or 32-bit integers, or floats");
    }
    if (!(page.channels >= 1 && page.channels <= 4) || (page.channels > 1 && page.planar != PLANARCONFIG_CONTIG)) {
        return unsupported(fmt::format("{} separate channels", page.channels), "1, or up to 4 interleaved ones");
    }
    const bool grey = page.photometric == PHOTOMETRIC_MINISBLACK || page.photometric == PHOTOMETRIC_MINISWHITE;
    if (!(grey || (page.photometric == PHOTOMETRIC_RGB && page.channels >= 3))) {
        return unsupported(fmt::format("photometric interpretation {}", page.photometric), "greyscale or RGB");
    }
    const double bytes = static_cast<double>(page.sampleBytes()) * page.channels;
    const double ratio = page.compression == COMPRESSION_NONE ? 1 : kBestRatio;
    if (Result<void> size = checkImageSize(path, page.width, page.height, bytes, ratio); !size) return size.error();
    return page;
}

template <class T>
void convertSamples(const unsigned char* from, std::size_t count, float* to) {
    for (std::size_t i = 0; i < count; ++i) {
        T value;
        std::memcpy(&value, from + i * sizeof(T), sizeof(T));
        to[i] = static_cast<float>(value);
    }
}

void convertSamples(const Page& page, const unsigned char* from, std::size_t count, float* to) {
    if (page.format == SAMPLEFORMAT_IEEEFP) {
        return page.bits == 32 ? convertSamples<float>(from, count, to) : convertSamples<double>(from, count, to);
    }
    const bool is_signed = page.format == SAMPLEFORMAT_INT;
    switch (page.bits) {
        case 8:
            return is_signed ? convertSamples<std::int8_t>(from, count, to)
                             : convertSamples<std::uint8_t>(from, count, to);
        case 16:
            return is_signed ? convertSamples<std::int16_t>(from, count, to)
                             : convertSamples<std::uint16_t>(from, count, to);
        default:
            return is_signed ? convertSamples<std::int32_t>(from, count, to)
                             : convertSamples<std::uint32_t>(from, count, to);
    }
}

// The pixels of the page that libtiff stands at, as luminance, bright = high.
Result<std::vector<float>> readPage(const fs::path& path, TIFF* tiff, const Page& page,
                                    std::vector<std::string>& notes) {
    const std::size_t row_samples = std::size_t{page.width} * page.channels;
    std::vector<float> samples(row_samples * page.height);
    if (TIFFIsTiled(tiff)) {
        std::uint32_t tile_width = 0, tile_height = 0;
        TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &tile_width);
        TIFFGetField(tiff, TIFFTAG_TILELENGTH, &tile_height);
        // a tile may stand out of the image, but not by much: the memory for it is bounded by the image's
        const std::uint64_t tile_bytes = std::uint64_t{tile_width} * tile_height * page.channels * page.sampleBytes();
        const bool sane = tile_width >= 1 && tile_height >= 1 && tile_width <= page.width + 4096 &&
                          tile_height <= page.height + 4096 && tile_bytes <= (std::uint64_t{1} << 30);
        if (!sane || static_cast<std::uint64_t>(TIFFTileSize(tiff)) != tile_bytes) return damaged(path);
        std::vector<unsigned char> tile(static_cast<std::size_t>(tile_bytes));
        for (std::uint32_t y = 0; y < page.height; y += tile_height) {
            for (std::uint32_t x = 0; x < page.width; x += tile_width) {
                const tmsize_t got = TIFFReadTile(tiff, tile.data(), x, y, 0, 0);
                if (got != static_cast<tmsize_t>(tile_bytes)) return damaged(path);
                const std::size_t columns = std::min(tile_width, page.width - x);
                for (std::uint32_t r = 0; r < std::min(tile_height, page.height - y); ++r) {
                    convertSamples(page, tile.data() + std::size_t{r} * tile_width * page.channels * page.sampleBytes(),
                                   columns * page.channels,
                                   samples.data() + (y + r) * row_samples + std::size_t{x} * page.channels);
                }
            }
        }
    } else {
        const std::size_t row_bytes = row_samples * page.sampleBytes();
        if (static_cast<std::uint64_t>(TIFFScanlineSize(tiff)) != row_bytes) return damaged(path);
        std::vector<unsigned char> row(row_bytes);
        for (std::uint32_t y = 0; y < page.height; ++y) {
            if (TIFFReadScanline(tiff, row.data(), y, 0) != 1) return damaged(path);
            convertSamples(page, row.data(), row_samples, samples.data() + y * row_samples);
        }
    }
    if (page.channels >= 3) samples = luminance(samples, page.channels, notes);
    if (page.channels == 2) {  // grey and transparency
        for (std::size_t i = 0; i < samples.size() / 2; ++i)
            samples[i] = samples[2 * i];
        samples.resize(samples.size() / 2);
    }
    if (page.photometric == PHOTOMETRIC_MINISWHITE && page.format == SAMPLEFORMAT_UINT) {
        mirrorValues(samples, 0, page.bits == 32 ? 4294967295.0 : (1 << page.bits) - 1);
        notes.push_back("the file stores white as 0: values were mirrored");
    }
    return samples;
}

}  // namespace

Result<ImageFile> readTiff(const fs::path& path, const ImageReadOptions& options) {
    const Tiff tiff = openTiff(path, "rm");
    if (!tiff) return damaged(path);
    const int frames = static_cast<int>(TIFFNumberOfDirectories(tiff.get()));
    if (Result<void> frame = checkFrame(path, options.frame, frames); !frame) return frame.error();
    if (!TIFFSetDirectory(tiff.get(), static_cast<tdir_t>(options.frame - 1))) return damaged(path);
    const Result<Page> page = readPageHeader(path, tiff.get());
    if (!page) return page.error();
    ImageFile result;
    Result<std::vector<float>> pixels = readPage(path, tiff.get(), *page, result.info.notes);
    if (!pixels) return pixels.error();
    result.info.format = "TIFF";
    result.info.frames = frames;
    result.info.frame = options.frame;
    result.info.bits = page->bits;
    result.info.is_float = page->format == SAMPLEFORMAT_IEEEFP;
    result.info.is_signed = page->format != SAMPLEFORMAT_UINT;
    result.image = Image(static_cast<int>(page->width), static_cast<int>(page->height), std::move(*pixels));
    return result;
}

Result<VolumeFile> readTiffStack(const fs::path& path, const VolumeReadOptions& options, Progress& progress) {
    const Tiff tiff = openTiff(path, "rm");
    if (!tiff) return damaged(path);
    const int pages = static_cast<int>(TIFFNumberOfDirectories(tiff.get()));
    if (pages < 2) {
        return invalidInput(path.string(), "a TIFF file of one page", "a volume (a stack of pages)");
    }
    if (!options.spacing_mm) {
        return invalidInput(path.string(), "a TIFF stack, which has no voxel spacing", "a volume with its spacing",
                            "give the spacing, or convert it to NRRD or NIfTI");
    }
    const Result<Page> first = readPageHeader(path, tiff.get());
    if (!first) return first.error();
    const std::uint64_t voxels = std::uint64_t{first->width} * first->height * static_cast<std::uint64_t>(pages);
    if (voxels > kMaxVolumeVoxels) {
        return invalidInput(path.string(), fmt::format("{} voxels", voxels),
                            fmt::format("at most {}", kMaxVolumeVoxels));
    }
    VolumeFile result;
    std::vector<float> values;
    for (int index = 0; index < pages; ++index) {
        if (progress.isCancelled()) return cancelled("reading " + path.string());
        if (!TIFFSetDirectory(tiff.get(), static_cast<tdir_t>(index))) return damaged(path);
        const Result<Page> page = readPageHeader(path, tiff.get());
        if (!page) return page.error();
        if (!page->sameAs(*first)) {
            return invalidInput(
                fmt::format("{}, page {}", path.string(), index + 1),
                fmt::format("{} x {} pixels of {} bits", page->width, page->height, page->bits),
                fmt::format("{} x {} of {} bits as on the first page", first->width, first->height, first->bits));
        }
        std::vector<std::string> notes;
        const Result<std::vector<float>> slice = readPage(path, tiff.get(), *page, notes);
        if (!slice) return slice.error();
        if (index == 0) result.info.notes = notes;
        values.insert(values.end(), slice->begin(), slice->end());
        progress.report((index + 1.0) / pages, "reading");
    }
    VolumeGrid grid;
    grid.size = {static_cast<int>(first->width), static_cast<int>(first->height), pages};
    grid.spacing_mm = *options.spacing_mm;
    result.info.format = "TIFF";
    result.info.bits = first->bits;
    result.info.is_float = first->format == SAMPLEFORMAT_IEEEFP;
    result.info.is_signed = first->format != SAMPLEFORMAT_UINT;
    result.info.notes.push_back("a TIFF stack: values as stored, spacing as given, position and orientation unknown");
    result.volume = Volume(grid, std::move(values));
    return result;
}

Result<void> writeTiff(const fs::path& path, const Image& image, PixelType type) {
    ElementType element = ElementType::float32;
    if (type == PixelType::uint8) element = ElementType::uint8;
    if (type == PixelType::uint16) element = ElementType::uint16;
    Result<std::string> bytes = encodeElements(path, image.pixels(), element);
    if (!bytes) return bytes.error();
    return writeWhole(path, [&](const fs::path& temporary) -> Result<void> {
        const Error failed = outputFailed(path.string(), "not all of it could be written", "free some space");
        Tiff tiff = openTiff(temporary, "w");
        if (!tiff) return failed;
        const auto height = static_cast<std::uint32_t>(image.height());
        const std::size_t row_bytes = bytes->size() / height;
        TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(image.width()));
        TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, height);
        TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, static_cast<int>(8 * byteCount(element)));
        TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
        TIFFSetField(tiff.get(), TIFFTAG_SAMPLEFORMAT,
                     element == ElementType::float32 ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
        TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
        TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
        TIFFSetField(tiff.get(), TIFFTAG_ROWSPERSTRIP, TIFFDefaultStripSize(tiff.get(), 0));
        for (std::uint32_t y = 0; y < height; ++y) {
            if (TIFFWriteScanline(tiff.get(), bytes->data() + y * row_bytes, y, 0) != 1) return failed;
        }
        if (!TIFFWriteDirectory(tiff.get())) return failed;
        return {};
    });
}

}  // namespace fluorocut

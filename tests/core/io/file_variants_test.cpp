// What other programs write and ours does not: big-endian, RAS, colour, palettes, tiles, white as zero.
#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>

#include "core/io/image_file.h"
#include "core/io/volume_file.h"
#include "tests/core/io/dicom_maker.h"
#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::content;
using test::put;
using ::testing::Contains;
using ::testing::HasSubstr;

// 2 x 3 x 2 voxels 0, 1, 2, ... as int16.
std::string voxels(bool big) {
    std::string bytes;
    for (int i = 0; i < 12; ++i) {
        const char low = static_cast<char>(i * 20), high = static_cast<char>(i - 6);
        bytes += big ? high : low;
        bytes += big ? low : high;
    }
    return bytes;
}
float voxel(int i) {
    return static_cast<float>((i - 6) * 256 + i * 20 % 256);
}

void expectVoxels(const Volume& volume) {
    for (int i = 0; i < 12; ++i)
        EXPECT_EQ(volume.voxels()[static_cast<std::size_t>(i)], voxel(i));
}

TEST(FileVariantsTest, MetaImageOfEitherByteOrderAndInTwoFiles) {
    const test::ScratchFolder scratch;
    const std::string header =
        "ObjectType = Image\nNDims = 3\nDimSize = 2 3 2\nElementSpacing = 1 2 3\nPosition = 4 5 6\n"
        "ElementType = MET_SHORT\n";
    put(scratch / "big.mha", header + "ElementByteOrderMSB = True\nElementDataFile = LOCAL\n" + voxels(true));
    put(scratch / "two.mhd", header + "HeaderSize = -1\nElementDataFile = two.raw\n");
    put(scratch / "two.raw", "a header of another program" + voxels(false));
    for (const char* name : {"big.mha", "two.mhd"}) {
        const Result<VolumeFile> read = readVolume(scratch / name);
        ASSERT_OK(read);
        expectVoxels(read->volume);
        EXPECT_EQ(read->volume.grid().origin_mm, Vector3(4, 5, 6));
        EXPECT_EQ(read->volume.grid().spacing_mm, Vector3(1, 2, 3));
    }
}

TEST(FileVariantsTest, NrrdSpacesAreBroughtToLps) {
    const test::ScratchFolder scratch;
    const auto grid = [&](const std::string& space) {
        put(scratch / "a.nrrd",
            "NRRD0005\n# a comment\ntype: short\ndimension: 3\nsizes: 2 3 2\nendian: big\n"
            "encoding: raw\nspace: " +
                space +
                "\nkey:=a value\n"
                "space directions: (1,0,0) (0,0,-2) (0,3,0)\nspace origin: (4,5,6)\n\n" +
                voxels(true));
        const Result<VolumeFile> read = readVolume(scratch / "a.nrrd");
        if (!read) throw std::runtime_error(read.error().message());
        expectVoxels(read->volume);
        EXPECT_EQ(read->volume.grid().spacing_mm, Vector3(1, 2, 3));
        return read->volume.grid();
    };
    // the centre of voxel (1, 1, 1) is (4 + 1, 5 + 3, 6 - 2) in the file's space
    EXPECT_LT((grid("left-posterior-superior").pointFromIndex(Vector3(1, 1, 1)) - Vector3(5, 8, 4)).norm(), 1e-12);
    EXPECT_LT((grid("RAS").pointFromIndex(Vector3(1, 1, 1)) - Vector3(-5, -8, 4)).norm(), 1e-12);
    EXPECT_LT((grid("left-anterior-superior").pointFromIndex(Vector3(1, 1, 1)) - Vector3(5, -8, 4)).norm(), 1e-12);
    EXPECT_THROW(grid("scanner-xyz"), std::runtime_error);
}

TEST(FileVariantsTest, NiftiScalesUnitsAndOrientations) {
    const test::ScratchFolder scratch;
    VolumeGrid grid;
    grid.size = {2, 3, 2};
    grid.spacing_mm = {1, 2, 3};
    grid.origin_mm = {4, 5, 6};
    Volume volume(grid);
    for (std::size_t i = 0; i < 12; ++i)
        volume.voxels()[i] = static_cast<float>(i);
    ASSERT_OK(writeVolume(scratch / "a.nii", volume, VoxelType::int16));
    const std::string good = content(scratch / "a.nii");
    const auto read = [&](std::initializer_list<std::pair<std::size_t, float>> floats, int sform, int qform,
                          char unit) {
        std::string bytes = good;
        for (const auto& [offset, value] : floats)
            std::memcpy(bytes.data() + offset, &value, 4);
        bytes[252] = static_cast<char>(qform);
        bytes[254] = static_cast<char>(sform);
        bytes[123] = unit;
        put(scratch / "b.nii", bytes);
        Result<VolumeFile> file = readVolume(scratch / "b.nii");
        if (!file) throw std::runtime_error(file.error().message());
        return std::move(*file);
    };
    const Vector3 far(1, 2, 1), there = grid.pointFromIndex(far);
    EXPECT_LT((read({}, 0, 1, 2).volume.grid().pointFromIndex(far) - there).norm(), 1e-5);  // qform alone
    EXPECT_LT((read({}, 1, 0, 2).volume.grid().pointFromIndex(far) - there).norm(), 1e-5);  // sform alone
    // neither: voxel axes along RAS from 0
    const VolumeFile unplaced = read({}, 0, 0, 2);
    EXPECT_LT((unplaced.volume.grid().pointFromIndex(far) - Vector3(-1, -4, 3)).norm(), 1e-5);
    EXPECT_THAT(unplaced.info.notes, Contains(HasSubstr("does not say how the patient lies")));
    EXPECT_NEAR(read({}, 1, 1, 1).volume.grid().spacing_mm.z(), 3000, 1e-3);   // metres
    EXPECT_NEAR(read({}, 1, 1, 3).volume.grid().spacing_mm.z(), 0.003, 1e-9);  // micrometres
    const VolumeFile scaled = read({{112, 2.f}, {116, -100.f}}, 1, 1, 2);
    EXPECT_EQ(scaled.volume.voxels()[7], 2 * 7 - 100);

    // the same file as a big-endian machine writes it: swap what this reader reads
    std::string swapped = good;
    const auto swap = [&](std::size_t at, std::size_t bytes) {
        std::reverse(swapped.begin() + static_cast<std::ptrdiff_t>(at),
                     swapped.begin() + static_cast<std::ptrdiff_t>(at + bytes));
    };
    swap(0, 4);
    for (std::size_t at = 40; at < 56; at += 2)
        swap(at, 2);
    swap(70, 2);
    swap(72, 2);
    for (std::size_t at = 76; at < 120; at += 4)
        swap(at, 4);
    swap(252, 2);
    swap(254, 2);
    for (std::size_t at = 256; at < 328; at += 4)
        swap(at, 4);
    for (std::size_t at = 352; at < swapped.size(); at += 2)
        swap(at, 2);
    put(scratch / "big.nii", swapped);
    const Result<VolumeFile> big = readVolume(scratch / "big.nii");
    ASSERT_OK(big);
    EXPECT_EQ(big->volume.voxels(), volume.voxels());
    EXPECT_LT((big->volume.grid().pointFromIndex(far) - there).norm(), 1e-5);
}

TEST(FileVariantsTest, ColourPngBecomesLuminance) {
    const test::ScratchFolder scratch;
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = 2;
    png.height = 1;
    png.format = PNG_FORMAT_RGBA;
    const std::uint8_t colours[] = {200, 100, 50, 255, 77, 77, 77, 128};
    ASSERT_TRUE(png_image_write_to_file(&png, (scratch / "a.png").c_str(), 0, colours, 0, nullptr));
    const Result<ImageFile> read = readImage(scratch / "a.png");
    ASSERT_OK(read);
    EXPECT_NEAR(read->image(0, 0), 0.2126 * 200 + 0.7152 * 100 + 0.0722 * 50, 1e-4);
    EXPECT_EQ(read->image(1, 0), 77);
    EXPECT_THAT(read->info.notes, Contains(HasSubstr("luminance")));

    png.format = PNG_FORMAT_RGB_COLORMAP;
    png.colormap_entries = 3;
    const std::uint8_t map[] = {10, 10, 10, 20, 20, 20, 250, 250, 250}, indices[] = {2, 1};
    ASSERT_TRUE(png_image_write_to_file(&png, (scratch / "b.png").c_str(), 0, indices, 0, map));
    const Result<ImageFile> palette = readImage(scratch / "b.png");
    ASSERT_OK(palette);
    EXPECT_EQ(palette->image.pixels(), (std::vector<float>{250, 20}));
    EXPECT_TRUE(palette->info.notes.empty());  // all grey: nothing was lost
}

struct TiffKind {
    int compression;
    bool tiled;
    bool white_is_zero;
};

void makeTiff(const fs::path& path, const Image& image, const TiffKind& kind) {
    TIFF* tiff = TIFFOpen(path.c_str(), "w");
    ASSERT_NE(tiff, nullptr);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.width());
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.height());
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 16);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.white_is_zero ? PHOTOMETRIC_MINISWHITE : PHOTOMETRIC_MINISBLACK);
    const auto stored = [&](int x, int y) {
        const float value = image(std::min(x, image.width() - 1), std::min(y, image.height() - 1));
        return static_cast<std::uint16_t>(kind.white_is_zero ? 65535 - value : value);
    };
    if (kind.tiled) {
        TIFFSetField(tiff, TIFFTAG_TILEWIDTH, 16);
        TIFFSetField(tiff, TIFFTAG_TILELENGTH, 32);
        std::vector<std::uint16_t> tile(16 * 32);
        for (int y = 0; y < image.height(); y += 32) {
            for (int x = 0; x < image.width(); x += 16) {
                for (int i = 0; i < 16 * 32; ++i)
                    tile[static_cast<std::size_t>(i)] = stored(x + i % 16, y + i / 16);
                TIFFWriteTile(tiff, tile.data(), static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 0, 0);
            }
        }
    } else {
        TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 7);
        std::vector<std::uint16_t> row(static_cast<std::size_t>(image.width()));
        for (int y = 0; y < image.height(); ++y) {
            for (int x = 0; x < image.width(); ++x)
                row[static_cast<std::size_t>(x)] = stored(x, y);
            TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y), 0);
        }
    }
    TIFFClose(tiff);
}

TEST(FileVariantsTest, TiffStripsTilesCompressionsAndWhiteAsZero) {
    const test::ScratchFolder scratch;
    Image image(37, 41);
    for (std::size_t i = 0; i < image.size(); ++i)
        image.pixels()[i] = static_cast<float>(i * 4001 % 65536);
    for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS}) {
        for (const bool tiled : {false, true}) {
            for (const bool white_is_zero : {false, true}) {
                makeTiff(scratch / "a.tif", image, {compression, tiled, white_is_zero});
                const Result<ImageFile> read = readImage(scratch / "a.tif");
                ASSERT_OK(read);
                EXPECT_EQ(read->image, image) << compression << tiled << white_is_zero;
            }
        }
    }
    // a compression that is left out on purpose
    std::string bytes = content(scratch / "a.tif");
    const std::size_t tag = bytes.find(std::string_view("\x03\x01\x03\x00\x01\x00\x00\x00", 8));
    ASSERT_NE(tag, std::string::npos);
    bytes[tag + 8] = 7;
    bytes[tag + 9] = 0;
    put(scratch / "jpeg.tif", bytes);
    const Result<ImageFile> refused = readImage(scratch / "jpeg.tif");
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message(), HasSubstr("TIFF compression 7"));
}

TEST(FileVariantsTest, ColourDicomBecomesLuminanceAndPalettesAreRefused) {
    const test::ScratchFolder scratch;
    for (const bool planar : {false, true}) {
        test::DicomImage image;
        image.width = 2;
        image.height = 1;
        image.bits_allocated = image.bits_stored = 8;
        image.pixels = planar ? std::vector<std::uint16_t>{200, 9, 100, 9, 50, 9}
                              : std::vector<std::uint16_t>{200, 100, 50, 9, 9, 9};
        image.attributes[{0x0028, 0x0002}] = "3";
        image.attributes[{0x0028, 0x0004}] = "RGB";
        image.attributes[{0x0028, 0x0006}] = planar ? "1" : "0";
        makeDicom(scratch / "a.dcm", image);
        const Result<ImageFile> read = readImage(scratch / "a.dcm");
        ASSERT_OK(read);
        EXPECT_NEAR(read->image(0, 0), 0.2126 * 200 + 0.7152 * 100 + 0.0722 * 50, 1e-4);
        EXPECT_EQ(read->image(1, 0), 9);
    }
    test::DicomImage palette;
    palette.width = palette.height = 2;
    palette.pixels = {1, 2, 3, 4};
    palette.attributes[{0x0028, 0x0004}] = "PALETTE COLOR";
    makeDicom(scratch / "b.dcm", palette);
    const Result<ImageFile> refused = readImage(scratch / "b.dcm");
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message(), HasSubstr("PALETTE COLOR"));
}

}  // namespace
}  // namespace fluorocut

// Volumes and images through MetaImage, NRRD, NIfTI, PNG and TIFF, there and back.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "core/io/image_file.h"
#include "core/io/volume_file.h"
#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::obliqueVolume;
using ::testing::HasSubstr;

void expectSamePlace(const VolumeGrid& a, const VolumeGrid& b, double tolerance_mm) {
    EXPECT_EQ(a.size, b.size);
    for (const Vector3& index :
         {Vector3(0, 0, 0), Vector3(6, 0, 0), Vector3(0, 4, 0), Vector3(0, 0, 3), Vector3(6, 4, 3)}) {
        EXPECT_LT((a.pointFromIndex(index) - b.pointFromIndex(index)).norm(), tolerance_mm);
    }
    EXPECT_LT((a.direction.transpose() * a.direction - Matrix3::Identity()).norm(), 1e-14);
}

class VolumeRoundTrip : public testing::TestWithParam<const char*> {};

TEST_P(VolumeRoundTrip, KeepsVoxelsAndPlace) {
    const test::ScratchFolder scratch;
    for (const bool left_handed : {false, true}) {
        const Volume volume = obliqueVolume(left_handed);
        for (const VoxelType type : {VoxelType::int16, VoxelType::float32}) {
            for (const bool compressed : {false, true}) {
                const auto path = scratch / (std::string("v") + GetParam());
                ASSERT_OK(writeVolume(path, volume, VolumeWriteOptions{type, compressed}));
                const Result<VolumeFile> read = readVolume(path);
                ASSERT_OK(read);
                EXPECT_EQ(read->volume.voxels(), volume.voxels());
                EXPECT_EQ(read->info.is_float, type == VoxelType::float32);
                EXPECT_EQ(read->info.least, -1000);
                EXPECT_TRUE(read->info.notes.empty());
                // MHA and NRRD write every digit of a double; NIfTI holds floats: 1000 mm to 6e-5
                const bool nifti = read->info.format == "NIfTI";
                expectSamePlace(read->volume.grid(), volume.grid(), nifti ? 2e-4 : 1e-9);
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Formats, VolumeRoundTrip, testing::Values(".mha", ".nrrd", ".nii", ".nii.gz"),
                         [](const auto& test) {
                             std::string name = std::string(test.param).substr(1);
                             std::replace(name.begin(), name.end(), '.', '_');
                             return name;
                         });

TEST(VolumeFileTest, RefusesVoxelsThatDoNotFitTheType) {
    const test::ScratchFolder scratch;
    Volume volume = obliqueVolume(false);
    volume(1, 1, 1) = 40000;
    const Result<void> written = writeVolume(scratch / "v.mha", volume, VoxelType::int16);
    ASSERT_FALSE(written.ok());
    EXPECT_THAT(written.error().message(), HasSubstr("40000"));
    EXPECT_FALSE(std::filesystem::exists(scratch / "v.mha"));
    EXPECT_FALSE(writeVolume(scratch / "v.xyz", volume).ok());
}

TEST(VolumeFileTest, RefusesVoxelsThatAreNotFinite) {
    const test::ScratchFolder scratch;
    Volume volume = obliqueVolume(false);
    volume(1, 1, 1) = NAN;
    ASSERT_OK(writeVolume(scratch / "v.mha", volume));
    const Result<VolumeFile> read = readVolume(scratch / "v.mha");
    ASSERT_FALSE(read.ok());
    EXPECT_THAT(read.error().message(), HasSubstr("1 voxels that are NaN"));
}

// The femur volume was made with its first voxel at RAS (-37.08, 170.50, -997.94) and axes along -x, -y, z of RAS: in
// LPS that is (37.08, -170.50, -997.94) with axes +x, +y, +z. Read from the header by hand (struct.unpack).
TEST(VolumeFileTest, BringsNiftiToLps) {
    SKIP_WITHOUT_SHARED_DATA();
    const Result<VolumeFile> file = readVolume(test::sharedData() / "ct/femur_m3_left_0.8mm.nii.gz");
    ASSERT_OK(file);
    const VolumeGrid& grid = file->volume.grid();
    EXPECT_EQ(grid.size, (std::array<int, 3>{180, 143, 268}));
    EXPECT_LT((grid.direction - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_LT((grid.spacing_mm - Vector3::Constant(0.8)).norm(), 1e-6);  // stored as float
    EXPECT_LT((grid.origin_mm - Vector3(37.0806, -170.5014, -997.9386)).norm(), 1e-3);
    EXPECT_EQ(file->info.format, "NIfTI");

    const Result<VolumeFile> hip = readVolume(test::sharedData() / "ct/tcga_09_2043_right_hip_crop.nii.gz");
    ASSERT_OK(hip);
    EXPECT_EQ(hip->volume.grid().size, (std::array<int, 3>{170, 170, 42}));
    EXPECT_LT((hip->volume.grid().spacing_mm - Vector3(1.03, 1.03, 3)).norm(), 1e-6);
    EXPECT_EQ(hip->info.least, -1024);
}

TEST(VolumeFileTest, ReadsATiffStackWhenToldItsSpacing) {
    SKIP_WITHOUT_SHARED_DATA();
    const auto path = test::sharedData() / "biplane/rad_dcm_cropped.tif";
    const Result<VolumeFile> untold = readVolume(path);
    ASSERT_FALSE(untold.ok());
    EXPECT_THAT(untold.error().message(), HasSubstr("spacing"));
    const Result<VolumeFile> told = readVolume(path, {"", Vector3(0.396, 0.396, 0.625)});
    ASSERT_OK(told);
    EXPECT_EQ(told->volume.grid().size, (std::array<int, 3>{68, 86, 128}));
    EXPECT_EQ(told->info.bits, 16);
    const Result<ImageFile> page = readImage(path, {100});
    ASSERT_OK(page);
    EXPECT_EQ(page->info.frames, 128);
    EXPECT_EQ(page->image(40, 50), told->volume(40, 50, 99));
    const Result<ImageFile> beyond = readImage(path, {129});
    ASSERT_FALSE(beyond.ok());
    EXPECT_THAT(beyond.error().message(), HasSubstr("1 to 128"));
}

Image ramp(int width, int height, float top) {
    Image image(width, height);
    std::mt19937 random(5);
    for (float& value : image.pixels())
        value = std::floor(static_cast<float>(random() % 65536) / 65535.f * top);
    return image;
}

TEST(ImageFileTest, IntegersComeBackAsTheyWere) {
    const test::ScratchFolder scratch;
    for (const char* name : {"a.png", "a.tif", "a.tiff", "a.mha", "a.nrrd"}) {
        for (const PixelType type : {PixelType::uint8, PixelType::uint16}) {
            const Image image = ramp(37, 23, type == PixelType::uint8 ? 255.f : 65535.f);
            ImageWriteOptions options;
            options.type = type;
            ASSERT_OK(writeImage(scratch / name, image, options)) << name;
            const Result<ImageFile> read = readImage(scratch / name);
            ASSERT_OK(read);
            EXPECT_EQ(read->image, image) << name;
            EXPECT_EQ(read->info.bits, type == PixelType::uint8 ? 8 : 16);
            EXPECT_EQ(read->info.width, 37);
            EXPECT_FALSE(read->info.is_float);
        }
    }
}

TEST(ImageFileTest, FloatsComeBackBitForBit) {
    const test::ScratchFolder scratch;
    Image image = ramp(37, 23, 1000);
    for (float& value : image.pixels())
        value = std::sqrt(value) - 7;
    image(3, 4) = NAN;  // a pixel without measurement is allowed in an image
    for (const char* name : {"a.tif", "a.mha", "a.nrrd"}) {
        ASSERT_OK(writeImage(scratch / name, image));
        const Result<ImageFile> read = readImage(scratch / name);
        ASSERT_OK(read);
        EXPECT_TRUE(std::isnan(read->image(3, 4)));
        EXPECT_THAT(read->info.notes, testing::ElementsAre(HasSubstr("1 pixels are not finite")));
        Image compare = read->image;
        compare(3, 4) = 0;
        Image expected = image;
        expected(3, 4) = 0;
        EXPECT_EQ(compare, expected);
        EXPECT_TRUE(read->info.is_float);
    }
    const Result<void> png = writeImage(scratch / "a.png", image);
    ASSERT_FALSE(png.ok());
    EXPECT_EQ(png.error().code, ErrorCode::invalidOption);
}

TEST(ImageFileTest, AWindowMapsValuesToTheWholeRange) {
    const test::ScratchFolder scratch;
    Image image(3, 1, std::vector<float>{-1, 0.5f, 9});
    ImageWriteOptions options;
    options.window = {{0.f, 1.f}};
    ASSERT_OK(writeImage(scratch / "a.png", image, options));
    const Result<ImageFile> read = readImage(scratch / "a.png");
    ASSERT_OK(read);
    EXPECT_EQ(read->image.pixels(), (std::vector<float>{0, 32768, 65535}));  // 32767.5 to even
}

TEST(ImageFileTest, SpacingIsKeptWithoutAPlane) {
    const test::ScratchFolder scratch;
    ImageWriteOptions options;
    options.pixel_spacing_mm = Vector2(0.3, 0.4);
    for (const char* name : {"a.mha", "a.nrrd"}) {
        ASSERT_OK(writeImage(scratch / name, ramp(5, 4, 9), options));
        const Result<ImageFile> read = readImage(scratch / name);
        ASSERT_OK(read);
        EXPECT_EQ(read->info.pixel_spacing_mm, Vector2(0.3, 0.4));
        EXPECT_EQ(read->info.spacing_plane, SpacingPlane::unstated);
    }
}

TEST(ImageFileTest, ASliceOfAVolumeIsAFrame) {
    const test::ScratchFolder scratch;
    const Volume volume = obliqueVolume(false);
    for (const char* name : {"v.mha", "v.nrrd"}) {
        for (const bool compressed : {false, true}) {
            ASSERT_OK(writeVolume(scratch / name, volume, VolumeWriteOptions{VoxelType::int16, compressed}));
            const Result<ImageFile> read = readImage(scratch / name, {3});
            ASSERT_OK(read);
            EXPECT_EQ(read->info.frames, 4);
            EXPECT_EQ(read->image(6, 2), volume(6, 2, 2));
        }
    }
}

TEST(ImageFileTest, ReadsRealTiffImages) {
    SKIP_WITHOUT_SHARED_DATA();
    for (const char* name : {"biplane/xr_rad_uln_cam01_UND.0002.tif", "biplane/xr_rad_uln_cam02_UND.0002.tif"}) {
        const Result<ImageFile> read = readImage(test::sharedData() / name);
        ASSERT_OK(read);
        EXPECT_EQ(read->info.width, 1760);
        EXPECT_EQ(read->info.height, 1760);
        EXPECT_EQ(read->info.bits, 8);
        EXPECT_GT(read->info.most, read->info.least + 100);
    }
}

TEST(FigureFileTest, ColoursArriveInTheirOrder) {
    const test::ScratchFolder scratch;
    ColorImage figure(3, 2, {255, 255, 255});
    figure(0, 0) = {200, 0, 0};
    figure(1, 0) = {0, 200, 0};
    figure(2, 0) = {0, 0, 200};
    ASSERT_OK(writeFigure(scratch / "figure.png", figure));
    const Result<ImageFile> read = readImage(scratch / "figure.png");
    ASSERT_OK(read);
    // Luminance of Rec. 709 tells the three apart.
    EXPECT_NEAR(read->image(0, 0), 0.2126 * 200, 0.5);
    EXPECT_NEAR(read->image(1, 0), 0.7152 * 200, 0.5);
    EXPECT_NEAR(read->image(2, 0), 0.0722 * 200, 0.5);
    EXPECT_NEAR(read->image(1, 1), 255, 0.5);
    EXPECT_EQ(writeFigure(scratch / "figure.tif", figure).error().code, ErrorCode::invalidOption);
}

}  // namespace
}  // namespace fluorocut

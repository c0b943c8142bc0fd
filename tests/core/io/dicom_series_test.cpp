#include <cmath>
#include <fstream>
#include <numbers>

#include <gtest/gtest.h>

#include "core/io/volume_file.h"
#include "tests/core/io/dicom_maker.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::CtSlice;
using test::ctValue;
using test::Syntax;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr std::pair<std::uint16_t, std::uint16_t> kModality{0x0008, 0x0060}, kImageType{0x0008, 0x0008},
    kInstance{0x0020, 0x0013}, kThickness{0x0018, 0x0050}, kPadding{0x0028, 0x0120}, kSlope{0x0028, 0x1053},
    kIntercept{0x0028, 0x1052}, kPosition{0x0020, 0x0032}, kOrientation{0x0020, 0x0037};

// Six slices 2 mm apart, written in an order that is neither that of names nor of instance numbers.
std::vector<CtSlice> stack(int count = 6) {
    std::vector<CtSlice> slices(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k) {
        CtSlice& slice = slices[static_cast<std::size_t>(k)];
        slice.id = k;
        slice.position = Vector3(-30.5, 12.25, -200 + 2.0 * k);
        slice.attributes[kInstance] = std::to_string((k * 5) % 7);
    }
    return slices;
}

class Series {
  public:
    explicit Series(const std::vector<CtSlice>& slices) {
        fs::create_directories(scratch_ / "ct/part");
        for (std::size_t k = 0; k < slices.size(); ++k) {
            const std::string file = "s" + std::to_string((k * 3) % 7) + "_" + std::to_string(k);
            makeCtSlice(scratch_ / ((k % 2 ? "ct/part/" : "ct/") + file), slices[k]);
        }
    }
    fs::path folder() const { return scratch_ / "ct"; }
    Result<VolumeFile> read(const VolumeReadOptions& options = {}) const { return readVolume(folder(), options); }
    std::string message() const {
        const Result<VolumeFile> file = read();
        if (file) return "no error";
        EXPECT_EQ(file.error().code, ErrorCode::invalidInput);
        EXPECT_THAT(file.error().message(), HasSubstr(folder().string()));
        return file.error().message();
    }

  private:
    test::ScratchFolder scratch_;
};

TEST(DicomSeriesTest, SlicesAreSortedByPositionAndInHounsfieldUnits) {
    for (const Syntax syntax : {Syntax::explicitLittle, Syntax::jpegLosslessSv1, Syntax::jpeg2000, Syntax::rle}) {
        std::vector<CtSlice> slices = stack();
        for (CtSlice& slice : slices)
            slice.syntax = syntax;
        const Result<VolumeFile> file = Series(slices).read();
        ASSERT_OK(file);
        const VolumeGrid& grid = file->volume.grid();
        EXPECT_EQ(grid.size, (std::array<int, 3>{12, 10, 6}));
        EXPECT_EQ(grid.spacing_mm, Vector3(0.75, 0.5, 2));
        EXPECT_EQ(grid.origin_mm, Vector3(-30.5, 12.25, -200));
        EXPECT_EQ(grid.direction, Matrix3::Identity());
        for (int k = 0; k < 6; ++k) {
            EXPECT_EQ(file->volume(0, 0, k), ctValue(0, 0, k));
            EXPECT_EQ(file->volume(11, 7, k), ctValue(11, 7, k));
        }
        EXPECT_EQ(file->info.files, 6);
        EXPECT_EQ(file->info.slice_thickness_mm, 2);
    }
}

TEST(DicomSeriesTest, ObliqueSlicesKeepTheirPlace) {
    std::vector<CtSlice> slices = stack();
    const Matrix3 rotation = Rigid3::fromTwistRollPitch(0.5, -0.3, 1.2).rotationMatrix();
    for (CtSlice& slice : slices) {
        slice.row = rotation.col(0);
        slice.column = rotation.col(1);
        slice.position = rotation * Vector3(-30, 12, 100 - 2.5 * slice.id);  // against the normal
    }
    const Result<VolumeFile> file = Series(slices).read();
    ASSERT_OK(file);
    const VolumeGrid& grid = file->volume.grid();
    EXPECT_NEAR(grid.spacing_mm.z(), 2.5, 1e-6);
    EXPECT_EQ(file->volume(3, 4, 0), ctValue(3, 4, 5));
    // pixel (x, y) of slice `id` lies at position + x column-step + y row-step; attributes hold 9 digits
    const Vector3 expected = slices[2].position + rotation * Vector3(11 * 0.75, 9 * 0.5, 0);
    EXPECT_LT((grid.pointFromIndex(Vector3(11, 9, 3)) - expected).norm(), 1e-6);
}

TEST(DicomSeriesTest, AGapNamesItsNeighbours) {
    std::vector<CtSlice> slices = stack(8);
    slices.erase(slices.begin() + 3);
    const std::string message = Series(slices).message();
    EXPECT_THAT(message, HasSubstr("a gap of 4.00 mm"));
    EXPECT_THAT(message, HasSubstr("1 slice is missing"));
    std::vector<CtSlice> uneven = stack(6);
    uneven[3].position.z() += 0.7;
    EXPECT_THAT(Series(uneven).message(), HasSubstr("not evenly spaced"));
}

TEST(DicomSeriesTest, PositionsMayBeRounded) {
    std::vector<CtSlice> slices = stack(8);
    for (CtSlice& slice : slices)
        slice.position.z() = std::round(slice.id * 0.625 * 100) / 100;  // two decimals
    EXPECT_OK(Series(slices).read());
}

TEST(DicomSeriesTest, DuplicatesAreNamed) {
    std::vector<CtSlice> slices = stack();
    slices.push_back(slices[2]);
    EXPECT_THAT(Series(slices).message(), HasSubstr("two slices at the same position, -196.00 mm"));
    slices[2].attributes[{0x0008, 0x0018}] = slices.back().attributes[{0x0008, 0x0018}] = "1.2.3.9";
    EXPECT_THAT(Series(slices).message(), HasSubstr("the same slice twice"));
}

TEST(DicomSeriesTest, WhatIsNotOneBlockIsNamed) {
    std::vector<CtSlice> turned = stack();
    turned[3].row = Vector3(0, 1, 0);
    turned[3].column = Vector3(0, 0, -1);
    EXPECT_THAT(Series(turned).message(), HasSubstr("an orientation"));
    std::vector<CtSlice> sized = stack();
    sized[4].width = 14;
    EXPECT_THAT(Series(sized).message(), HasSubstr("a size of"));
    std::vector<CtSlice> spaced = stack();
    spaced[4].between_rows_mm = 0.51;
    EXPECT_THAT(Series(spaced).message(), HasSubstr("a pixel spacing of 0.75 x 0.51 mm"));
}

TEST(DicomSeriesTest, ATiltedGantryIsNamed) {
    std::vector<CtSlice> slices = stack();
    const double tilt = 10 * std::numbers::pi / 180;
    for (CtSlice& slice : slices) {
        slice.column = Vector3(0, std::cos(tilt), std::sin(tilt));  // slices lean, the table moves along z
    }
    EXPECT_THAT(Series(slices).message(), HasSubstr("a gantry tilt of 10.0 degrees"));
}

TEST(DicomSeriesTest, OneOfSeveralSeriesHasToBeChosen) {
    std::vector<CtSlice> slices = stack();
    std::vector<CtSlice> other = stack(4);
    for (CtSlice& slice : other) {
        slice.series = "1.2.3.5";
        slices.push_back(slice);
    }
    const Series series(slices);
    EXPECT_THAT(series.message(), HasSubstr("2 series: 1.2.3.4 (6 slices), 1.2.3.5 (4 slices)"));
    const Result<VolumeFile> chosen = series.read({"1.2.3.5", std::nullopt});
    ASSERT_OK(chosen);
    EXPECT_EQ(chosen->volume.size(2), 4);
    EXPECT_FALSE(series.read({"1.2.3.6", std::nullopt}).ok());
}

TEST(DicomSeriesTest, OtherFilesArePassedOverAndCounted) {
    std::vector<CtSlice> slices = stack();
    slices.push_back(slices[0]);
    slices.back().attributes[kImageType] = "ORIGINAL\\PRIMARY\\LOCALIZER";
    slices.push_back(slices[0]);
    slices.back().attributes[kModality] = "XA";
    const Series series(slices);
    std::ofstream(series.folder() / "README.txt") << "not DICOM";
    const Result<VolumeFile> file = series.read();
    ASSERT_OK(file);
    EXPECT_EQ(file->info.files, 6);
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("1 files that are not DICOM")));
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("1 DICOM files that are not CT")));
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("1 localizers")));
}

TEST(DicomSeriesTest, PaddingBecomesAirAndEachSliceHasItsOwnRescale) {
    std::vector<CtSlice> slices = stack();
    for (CtSlice& slice : slices) {
        // stored = HU + 1024
        slice.attributes[kPadding] = std::to_string(static_cast<int>(ctValue(3, 0, slice.id)) + 1024);
    }
    slices[1].attributes[kSlope] = "2";
    slices[1].attributes[kIntercept] = "-1000";
    const Result<VolumeFile> file = Series(slices).read();
    ASSERT_OK(file);
    EXPECT_EQ(file->volume(3, 0, 2), -1000);
    EXPECT_EQ(file->volume(4, 0, 2), ctValue(4, 0, 2));
    EXPECT_EQ(file->volume(4, 0, 1), 2 * (ctValue(4, 0, 1) + 1024) - 1000);
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("padding pixels")));
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("different rescale")));
}

TEST(DicomSeriesTest, OverlapAndDistanceOfSlicesAreNoted) {
    std::vector<CtSlice> slices = stack();
    for (CtSlice& slice : slices)
        slice.attributes[kThickness] = "3";
    const Result<VolumeFile> thick = Series(slices).read();
    ASSERT_OK(thick);
    EXPECT_THAT(thick->info.notes, Contains(HasSubstr("3 mm thick and 2 mm apart: they overlap")));
    for (CtSlice& slice : slices)
        slice.attributes[kThickness] = "1";
    const Result<VolumeFile> thin = Series(slices).read();
    ASSERT_OK(thin);
    EXPECT_THAT(thin->info.notes, Contains(HasSubstr("was not imaged")));
}

TEST(DicomSeriesTest, GeometryThatIsMissingOrNonsenseIsRefused) {
    for (const auto& [key, value] : std::vector<std::pair<std::pair<std::uint16_t, std::uint16_t>, std::string>>{
             {kPosition, "nan\\0\\0"},
             {kPosition, "0\\0"},
             {kPosition, ""},
             {kPosition, "1e300\\0\\0"},
             {kOrientation, "1\\0\\0\\1\\0\\0"},
             {kOrientation, "0\\0\\0\\0\\1\\0"},
             {{0x0028, 0x0030}, "0\\1"},
             {{0x0028, 0x0030}, "-1\\1"},
             {{0x0028, 0x0030}, "inf\\1"},
             {kSlope, "0"},
             {kIntercept, "nan"}}) {
        std::vector<CtSlice> slices = stack(3);
        slices[1].attributes[key] = value;
        EXPECT_THAT(Series(slices).message(), HasSubstr("DICOM")) << value;
    }
    EXPECT_THAT(Series(stack(1)).message(), HasSubstr("one CT slice"));
    EXPECT_THAT(Series({}).message(), HasSubstr("empty folder"));
}

TEST(DicomSeriesTest, ADamagedSliceIsNamedNotSkipped) {
    const Series series(stack());
    fs::path victim;
    for (const auto& entry : fs::directory_iterator(series.folder())) {
        if (entry.is_regular_file()) victim = entry.path();
    }
    fs::resize_file(victim, fs::file_size(victim) - 40);
    EXPECT_THAT(series.message(), HasSubstr(victim.filename().string()));
}

class CancelAfter final : public Progress {
  public:
    explicit CancelAfter(int reports) : left_(reports) {}
    void report(double fraction, std::string_view) override {
        EXPECT_GE(fraction, last_);
        EXPECT_LE(fraction, 1);
        last_ = fraction;
        --left_;
    }
    bool isCancelled() const override { return left_ < 0; }

  private:
    int left_;
    double last_ = 0;
};

TEST(DicomSeriesTest, CanBeCancelled) {
    const Series series(stack());
    CancelAfter soon(2), never(1000);
    const Result<VolumeFile> stopped = readVolume(series.folder(), {}, soon);
    ASSERT_FALSE(stopped.ok());
    EXPECT_TRUE(stopped.error().isCancelled());
    EXPECT_OK(readVolume(series.folder(), {}, never));
}

// 20 slices, 512 x 512, 2 mm apart and 3 mm thick, first at z = -804.5 (positions printed with pydicom).
TEST(DicomSeriesTest, ReadsARealSeriesInJpeg2000) {
    SKIP_WITHOUT_SHARED_DATA();
    const Result<VolumeFile> file = readVolume(test::sharedData() / "ct/ct_abdomen_j2k_dicom");
    ASSERT_OK(file);
    const VolumeGrid& grid = file->volume.grid();
    EXPECT_EQ(grid.size, (std::array<int, 3>{512, 512, 20}));
    EXPECT_EQ(grid.spacing_mm, Vector3(0.9765625, 0.9765625, 2));
    EXPECT_EQ(grid.origin_mm, Vector3(-249.51171875, -437.51171875, -804.5));
    EXPECT_EQ(file->info.slice_thickness_mm, 3);
    EXPECT_THAT(file->info.transfer_syntax, HasSubstr("JPEG 2000"));
    EXPECT_THAT(file->info.notes, Contains(HasSubstr("they overlap")));
    EXPECT_GE(file->info.least, -1024);
    EXPECT_LE(file->info.most, 3071);  // 12 bits less 1024
    // Physics: the corner is air; neighbouring overlapping slices of a body differ by noise, not by hundreds of HU.
    EXPECT_LT(file->volume(2, 2, 0), -900);
    double difference = 0, tissue = 0;
    int count = 0;
    for (int y = 150; y < 350; ++y) {
        for (int x = 150; x < 350; ++x) {
            difference += std::abs(file->volume(x, y, 10) - file->volume(x, y, 11));
            tissue += file->volume(x, y, 10) > -200 && file->volume(x, y, 10) < 300;
            ++count;
        }
    }
    EXPECT_LT(difference / count, 60);
    EXPECT_GT(tissue / count, 0.5);
}

}  // namespace
}  // namespace fluorocut

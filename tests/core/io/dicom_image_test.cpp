#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numeric>

#include <gtest/gtest.h>

#include "core/io/image_file.h"
#include "tests/core/io/dicom_maker.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::DicomImage;
using test::Syntax;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr std::pair<std::uint16_t, std::uint16_t> kModality{0x0008, 0x0060}, kPhotometric{0x0028, 0x0004},
    kRelationship{0x0028, 0x1040}, kSign{0x0028, 0x1041}, kPixelSpacing{0x0028, 0x0030}, kImager{0x0018, 0x1164},
    kCalibration{0x0028, 0x0A02}, kSlope{0x0028, 0x1053}, kIntercept{0x0028, 0x1052};

DicomImage gradient(int frames = 1, int bits = 12) {
    DicomImage image;
    image.width = 24;
    image.height = 17;
    image.frames = frames;
    image.bits_stored = bits;
    image.bits_allocated = bits <= 8 ? 8 : 16;
    const int range = 1 << bits;
    for (int f = 0; f < frames; ++f) {
        for (int y = 0; y < image.height; ++y) {
            for (int x = 0; x < image.width; ++x) {
                image.pixels.push_back(static_cast<std::uint16_t>((x * range / 40 + y * range / 60 + f * 7) % range));
            }
        }
    }
    return image;
}

Result<ImageFile> roundTrip(const DicomImage& image, const ImageReadOptions& options = {}) {
    const test::ScratchFolder scratch;
    makeDicom(scratch / "image.dcm", image);
    return readImage(scratch / "image.dcm", options);
}

float largestDifference(const Image& image, const DicomImage& expected, int frame) {
    float worst = 0;
    for (std::size_t i = 0; i < image.size(); ++i) {
        const float stored = expected.pixels[static_cast<std::size_t>(frame) * image.size() + i];
        worst = std::max(worst, std::abs(image.pixels()[i] - stored));
    }
    return worst;
}

TEST(DicomImageTest, EveryLosslessTransferSyntaxGivesTheSamePixels) {
    for (const Syntax syntax :
         {Syntax::implicitLittle, Syntax::explicitLittle, Syntax::explicitBig, Syntax::deflated, Syntax::rle,
          Syntax::jpegLossless, Syntax::jpegLosslessSv1, Syntax::jpegLs, Syntax::jpeg2000}) {
        for (const int bits : {8, 12, 16}) {
            DicomImage image = gradient(3, bits);
            image.syntax = syntax;
            for (int frame = 0; frame < 3; ++frame) {
                const Result<ImageFile> read = roundTrip(image, {frame + 1});
                ASSERT_OK(read);
                EXPECT_EQ(largestDifference(read->image, image, frame), 0)
                    << read->info.transfer_syntax << ", " << bits << " bits, frame " << frame;
                EXPECT_EQ(read->info.frames, 3);
                EXPECT_EQ(read->info.bits, bits);
            }
        }
    }
}

TEST(DicomImageTest, LossyJpegIsClose) {
    DicomImage image = gradient(1, 8);
    // a smooth ramp over the whole range: DCMTK's encoder stretches what it is given to that range
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = static_cast<std::uint16_t>(i % 24 * 255 / 23);
    image.syntax = Syntax::jpegBaseline;
    const Result<ImageFile> baseline = roundTrip(image);
    ASSERT_OK(baseline);
    EXPECT_LE(largestDifference(baseline->image, image, 0), 4);  // quality 95: quantisation steps of 1 to 10 of 255
    DicomImage wide = gradient(1, 12);
    for (std::size_t i = 0; i < wide.pixels.size(); ++i)
        wide.pixels[i] = static_cast<std::uint16_t>(i % 24 * 4095 / 23);
    wide.syntax = Syntax::jpegExtended;
    const Result<ImageFile> extended = roundTrip(wide);
    ASSERT_OK(extended);
    EXPECT_LE(largestDifference(extended->image, wide, 0), 64);  // the same of 4095
}

TEST(DicomImageTest, AFrameOutOfRangeIsNamed) {
    for (const int frame : {0, 4, -1}) {
        const Result<ImageFile> read = roundTrip(gradient(3), {frame});
        ASSERT_FALSE(read.ok());
        EXPECT_THAT(read.error().message(), HasSubstr("3 frames"));
        EXPECT_THAT(read.error().message(), HasSubstr("from 1 to 3"));
    }
}

TEST(DicomImageTest, SignedPixelsKeepTheirSign) {
    for (const Syntax syntax : {Syntax::explicitLittle, Syntax::explicitBig, Syntax::rle, Syntax::jpeg2000}) {
        DicomImage image = gradient(1, 12);
        image.is_signed = true;
        image.syntax = syntax;
        image.attributes[kModality] = "CT";  // no mirroring
        for (std::size_t i = 0; i < image.pixels.size(); ++i) {
            const int value = static_cast<int>(i) * 9 - 2048;
            image.pixels[i] = static_cast<std::uint16_t>(value & 0x0FFF);
        }
        const Result<ImageFile> read = roundTrip(image);
        ASSERT_OK(read);
        EXPECT_EQ(read->image(0, 0), -2048);
        EXPECT_EQ(read->image(5, 2), (2 * 24 + 5) * 9 - 2048);
        EXPECT_TRUE(read->info.is_signed);
    }
}

TEST(DicomImageTest, BitsAboveTheStoredOnesAreNotPixels) {
    DicomImage image = gradient(1, 12);
    const DicomImage clean = image;
    for (std::uint16_t& pixel : image.pixels)
        pixel |= 0xA000;  // overlays of old files
    const Result<ImageFile> read = roundTrip(image);
    ASSERT_OK(read);
    EXPECT_EQ(largestDifference(read->image, clean, 0), 0);
}

TEST(DicomImageTest, BrightMeansMorePhotons) {
    struct Case {
        std::string modality, photometric, relationship, sign;
        bool mirrored;
    };
    for (const Case& c : {Case{"XA", "MONOCHROME2", "LIN", "", false}, Case{"XA", "MONOCHROME1", "LIN", "", true},
                          Case{"RF", "MONOCHROME2", "", "", false}, Case{"DX", "MONOCHROME2", "LOG", "-1", true},
                          Case{"DX", "MONOCHROME1", "LOG", "-1", true}, Case{"DX", "MONOCHROME2", "LIN", "1", false},
                          Case{"XA", "MONOCHROME2", "LIN", "-1", true}, Case{"CR", "MONOCHROME2", "", "", true},
                          Case{"CR", "MONOCHROME1", "", "", false}, Case{"OT", "MONOCHROME2", "", "", false}}) {
        DicomImage image = gradient(1, 12);
        image.attributes[kModality] = c.modality;
        image.attributes[kPhotometric] = c.photometric;
        if (!c.relationship.empty()) image.attributes[kRelationship] = c.relationship;
        if (!c.sign.empty()) image.attributes[kSign] = c.sign;
        const Result<ImageFile> read = roundTrip(image);
        ASSERT_OK(read);
        const float stored = image.pixels[30];
        EXPECT_EQ(read->image.pixels()[30], c.mirrored ? 4095 - stored : stored)
            << c.modality << " " << c.photometric << " sign " << c.sign;
        EXPECT_THAT(read->info.notes,
                    c.mirrored ? testing::Matcher<const std::vector<std::string>&>(Contains(HasSubstr("were mirrored")))
                               : testing::Not(Contains(HasSubstr("were mirrored"))));
        ImageReadOptions other;
        other.brightness = c.mirrored ? BrightnessRule::asStored : BrightnessRule::mirrored;
        const Result<ImageFile> overruled = roundTrip(image, other);
        ASSERT_OK(overruled);
        EXPECT_EQ(overruled->image.pixels()[30], c.mirrored ? stored : 4095 - stored);
    }
}

TEST(DicomImageTest, RescaleIsAppliedAfterTheDirectionIsSettled) {
    DicomImage image = gradient(1, 12);
    image.attributes[kSlope] = "-2";
    image.attributes[kIntercept] = "10";
    image.attributes[kSign] = "-1";
    const Result<ImageFile> read = roundTrip(image);
    ASSERT_OK(read);
    // high stored = fewer photons; the negative slope has turned that already
    EXPECT_EQ(read->image.pixels()[30], 10 - 2 * static_cast<float>(image.pixels[30]));
    image.attributes[kSlope] = "nan";
    EXPECT_FALSE(roundTrip(image).ok());
}

TEST(DicomImageTest, SpacingSaysItsPlane) {
    struct Case {
        std::string pixel, imager, calibration;
        SpacingPlane plane;
        std::optional<Vector2> spacing;
    };
    for (const Case& c : {Case{"", "", "", SpacingPlane::none, std::nullopt},
                          Case{"", "0.4\\0.3", "", SpacingPlane::detector, Vector2(0.3, 0.4)},
                          Case{"0.4\\0.3", "0.4\\0.3", "", SpacingPlane::detector, Vector2(0.3, 0.4)},
                          Case{"0.2\\0.15", "0.4\\0.3", "", SpacingPlane::calibrated, Vector2(0.15, 0.2)},
                          Case{"0.2\\0.15", "0.4\\0.3", "GEOMETRY", SpacingPlane::calibrated, Vector2(0.15, 0.2)},
                          Case{"0.2\\0.15", "", "FIDUCIAL", SpacingPlane::calibrated, Vector2(0.15, 0.2)},
                          Case{"0.2\\0.15", "", "", SpacingPlane::unstated, Vector2(0.15, 0.2)}}) {
        DicomImage image = gradient();
        if (!c.pixel.empty()) image.attributes[kPixelSpacing] = c.pixel;
        if (!c.imager.empty()) image.attributes[kImager] = c.imager;
        if (!c.calibration.empty()) image.attributes[kCalibration] = c.calibration;
        const Result<ImageFile> read = roundTrip(image);
        ASSERT_OK(read);
        EXPECT_EQ(read->info.spacing_plane, c.plane) << c.pixel << " " << c.imager;
        EXPECT_EQ(read->info.pixel_spacing_mm, c.spacing);
    }
    for (const char* spacing : {"0\\0.3", "nan\\0.3", "-0.3\\0.3", "0.3", "1e9\\1e9", "x\\y"}) {
        DicomImage image = gradient();
        image.attributes[kImager] = spacing;
        const Result<ImageFile> read = roundTrip(image);
        ASSERT_FALSE(read.ok()) << spacing;
        EXPECT_THAT(read.error().message(), HasSubstr("ImagerPixelSpacing"));
    }
}

TEST(DicomImageTest, SecondaryCaptureComesBackAndNamesNobody) {
    const test::ScratchFolder scratch;
    for (const PixelType type : {PixelType::uint8, PixelType::uint16}) {
        Image image(13, 9);
        for (std::size_t i = 0; i < image.size(); ++i) {
            image.pixels()[i] = static_cast<float>((i * 569) % (type == PixelType::uint8 ? 256 : 65536));
        }
        ImageWriteOptions options;
        options.type = type;
        options.pixel_spacing_mm = Vector2(0.3, 0.4);
        ASSERT_OK(writeImage(scratch / "a.dcm", image, options));
        const Result<ImageFile> read = readImage(scratch / "a.dcm");
        ASSERT_OK(read);
        EXPECT_EQ(read->image, image);
        EXPECT_EQ(read->info.modality, "OT");
        EXPECT_FALSE(read->info.has_identifying_fields);
        EXPECT_EQ(read->info.pixel_spacing_mm, Vector2(0.3, 0.4));
        EXPECT_EQ(read->info.spacing_plane, SpacingPlane::detector);
    }
    // UIDs differ from file to file and are valid: digits in components without leading zeros, at most 64 characters
    ASSERT_OK(writeImage(scratch / "b.dcm", Image(2, 2, 1.f)));
    const auto uids = [](const fs::path& path) {
        std::ifstream stream(path, std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
        std::vector<std::string> found;
        for (std::size_t at = bytes.find("2.25."); at != std::string::npos; at = bytes.find("2.25.", at + 1)) {
            found.push_back(bytes.substr(at, bytes.find_first_not_of("0123456789.", at) - at));
        }
        return found;
    };
    const std::vector<std::string> a = uids(scratch / "a.dcm"), b = uids(scratch / "b.dcm");
    ASSERT_EQ(a.size(), 4u);  // instance (twice: also in the meta header), study, series
    for (const std::string& uid : a) {
        EXPECT_EQ(uid.size(), 43u);
        EXPECT_NE(uid[5], '0');
        EXPECT_THAT(b, testing::Not(Contains(uid)));
    }
}

// Expected sums and pixels of the next tests were printed with pydicom 2.3.1 (pixel_array, before any mirroring).
struct RealImage {
    const char* file;
    const char* modality;
    int width, height, bits;
    double stored_sum;
    float at_400_300;
    bool mirrored;
    SpacingPlane plane;
    double spacing_mm;
};

class RealDicomImage : public testing::TestWithParam<RealImage> {};

TEST_P(RealDicomImage, IsReadAsAnotherProgramReadsIt) {
    SKIP_WITHOUT_SHARED_DATA();
    const RealImage& expected = GetParam();
    const Result<ImageFile> read = readImage(test::sharedData() / "xray" / expected.file);
    ASSERT_OK(read);
    const ImageInfo& info = read->info;
    EXPECT_EQ(info.modality, expected.modality);
    EXPECT_EQ(info.width, expected.width);
    EXPECT_EQ(info.height, expected.height);
    EXPECT_EQ(info.bits, expected.bits);
    const double top = (1 << expected.bits) - 1;
    double sum = 0;
    for (const float value : read->image.pixels())
        sum += static_cast<double>(value);
    const double count = static_cast<double>(read->image.size());
    EXPECT_EQ(expected.mirrored ? top * count - sum : sum, expected.stored_sum);
    const float there = read->image(400, 300);
    EXPECT_EQ(expected.mirrored ? static_cast<float>(top) - there : there, expected.at_400_300);
    EXPECT_EQ(info.spacing_plane, expected.plane);
    EXPECT_EQ(info.pixel_spacing_mm ? info.pixel_spacing_mm->x() : 0, expected.spacing_mm);
    EXPECT_TRUE(info.has_identifying_fields);  // test names, but names
}

INSTANTIATE_TEST_SUITE_P(
    Files, RealDicomImage,
    testing::Values(
        RealImage{"CR_CHEST_expl_1.dcm", "CR", 512, 512, 8, 3400170, 0, true, SpacingPlane::calibrated, 0.25},
        RealImage{"CR_CHEST_expl_2.dcm", "CR", 512, 512, 8, 2311830, 0, true, SpacingPlane::detector, 0.5},
        RealImage{"CR_HIP_rle_1.dcm", "CR", 1760, 2140, 10, 1696297313, 735, true, SpacingPlane::unstated, 0.2},
        // pydicom has no decoder for this one here; it is the RLE file's picture
        RealImage{"CR_HIP_jpegll_1.dcm", "CR", 1760, 2140, 10, 1696297313, 735, true, SpacingPlane::unstated, 0.2},
        RealImage{"DX_na_expl_1.dcm", "DX", 512, 512, 8, 3400170, 0, true, SpacingPlane::calibrated, 0.25},
        RealImage{"DX_na_expl_2.dcm", "DX", 512, 512, 8, 2311830, 0, true, SpacingPlane::detector, 0.5},
        RealImage{"RF_na_expl_1.dcm", "RF", 1024, 1024, 10, 854044577, 456, false, SpacingPlane::detector, 0.293},
        RealImage{"XA_BRAIN_expl_1.dcm", "XA", 512, 512, 8, 3400170, 0, false, SpacingPlane::calibrated, 0.25},
        RealImage{"XA_na_rle_1.dcm", "XA", 1024, 1024, 10, 112478027, 119, false, SpacingPlane::none, 0}),
    [](const auto& test) {
        const std::string name = test.param.file;
        return name.substr(0, name.find('.'));
    });

TEST(DicomImageTest, ARealFluoroscopyFileTellsItsGeometry) {
    SKIP_WITHOUT_SHARED_DATA();
    const Result<ImageFile> read = readImage(test::sharedData() / "xray/RF_na_expl_1.dcm");
    ASSERT_OK(read);
    EXPECT_EQ(read->info.source_detector_mm, 1150);
    EXPECT_EQ(read->info.source_patient_mm, 972);
    EXPECT_EQ(read->info.intensity, IntensityScale::linear);
    EXPECT_EQ(read->info.manufacturer, "SIEMENS");
    EXPECT_THAT(read->info.notes, Contains(HasSubstr("PixelIntensityRelationshipSign is absent")));
}

}  // namespace
}  // namespace fluorocut

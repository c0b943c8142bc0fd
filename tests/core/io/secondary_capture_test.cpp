// Captures for the archive: what goes in comes out of our own reader, and a program of others finds no fault in them.
#include "core/io/secondary_capture.h"

#include <filesystem>

#include <gmock/gmock.h>

#include "core/io/formats/dicom_file.h"
#include "core/io/image_file.h"
#include "tests/support/fixtures.h"
#include "tests/support/program.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr DicomTag kPatientName{0x0010, 0x0010}, kPatientId{0x0010, 0x0020}, kStudyUid{0x0020, 0x000D},
    kStudyDate{0x0008, 0x0020}, kStudyTime{0x0008, 0x0030}, kStudyDescription{0x0008, 0x1030},
    kLaterality{0x0020, 0x0060}, kSeriesNumber{0x0020, 0x0011}, kInstanceNumber{0x0020, 0x0013},
    kBurnedIn{0x0028, 0x0301}, kCharacterSet{0x0008, 0x0005};

CaptureTags tags() {
    CaptureTags tags;
    tags.patient_name = "Müller, Änne";
    tags.patient_id = "4711";
    tags.side = "left";
    tags.study_uid = uidFromHash("00112233445566778899aabbccddeeff");
    tags.series_uid = uidFromHash("10112233445566778899aabbccddeeff");
    tags.instance_uid = uidFromHash("20112233445566778899aabbccddeeff");
    tags.study_id = "29f126745623285a97ff";
    tags.study_description = "FluoroCut: demo";
    tags.series_description = "FluoroCut: planned views";
    tags.study_utc = "2026-03-01T09:30:07.125Z";
    tags.series_number = 2;
    tags.instance_number = 3;
    tags.software = "FluoroCut 0.1.0";
    return tags;
}

// Odd sizes: an odd number of bytes has to be padded.
ColorImage colours() {
    ColorImage picture(7, 5);
    for (int y = 0; y < 5; ++y)
        for (int x = 0; x < 7; ++x)
            picture(x, y) = {static_cast<std::uint8_t>(30 * x), static_cast<std::uint8_t>(50 * y),
                             static_cast<std::uint8_t>(200 - 10 * x - 10 * y)};
    return picture;
}

TEST(SecondaryCapture, TagsAndColoursComeBack) {
    const test::ScratchFolder scratch;
    const auto path = scratch / "capture.dcm";
    const ColorImage picture = colours();
    ASSERT_OK(writeCapture(path, picture, tags()));
    const Result<DicomFile> file = DicomFile::open(path);
    ASSERT_OK(file);
    EXPECT_EQ(file->text(tag::kSopClass), "1.2.840.10008.5.1.4.1.1.7");  // Secondary Capture Image Storage, PS3.4 B.5
    EXPECT_EQ(file->text(kPatientName), "Müller^Änne");
    EXPECT_EQ(file->text(kCharacterSet), "ISO_IR 192");
    EXPECT_EQ(file->text(kPatientId), "4711");
    EXPECT_EQ(file->text(kStudyUid), tags().study_uid);
    EXPECT_EQ(file->text(tag::kSeriesInstance), tags().series_uid);
    EXPECT_EQ(file->text(tag::kSopInstance), tags().instance_uid);
    EXPECT_EQ(file->text(kStudyDate), "20260301");
    EXPECT_EQ(file->text(kStudyTime), "093007");
    EXPECT_EQ(file->text(kStudyDescription), "FluoroCut: demo");
    EXPECT_EQ(file->text(kLaterality), "L");
    EXPECT_EQ(file->text(kSeriesNumber), "2");
    EXPECT_EQ(file->text(kInstanceNumber), "3");
    EXPECT_EQ(file->text(kBurnedIn), "YES");
    const Result<DicomPixelFormat> format = file->pixelFormat();
    ASSERT_OK(format);
    ASSERT_EQ(format->samples, 3);
    const Result<std::vector<float>> values = file->frame(*format, 0);
    ASSERT_OK(values);
    ASSERT_EQ(values->size(), 3 * picture.size());
    for (std::size_t i = 0; i < picture.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c)
            ASSERT_EQ((*values)[3 * i + c], picture.pixels()[i][c]) << i;
    // As an image of levels: its luminance (Rec. 709).
    const Result<ImageFile> read = readImage(path);
    ASSERT_OK(read);
    const auto& pixel = picture(3, 2);
    EXPECT_NEAR(read->image(3, 2), 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2], 0.1);
    EXPECT_TRUE(read->info.has_identifying_fields);
}

// dciodvfy (dicom3tools) holds a file against the standard's definition of its kind.
TEST(SecondaryCapture, AnotherProgramFindsNoFault) {
    const test::ScratchFolder scratch;
    const auto path = scratch / "capture.dcm";
    ASSERT_OK(writeCapture(path, colours(), tags()));
    const test::Finished check = test::runProgram(
        "/bin/sh", {"-c", "command -v dciodvfy >/dev/null || exit 99; dciodvfy -new '" + path.string() + "' 2>&1"});
    if (check.exit_code == 99) GTEST_SKIP() << "no dciodvfy";
    EXPECT_EQ(check.exit_code, 0);
    EXPECT_THAT(check.out, HasSubstr("SCImage"));
    EXPECT_THAT(check.out, Not(HasSubstr("Error")));
}

TEST(SecondaryCapture, TextThatWouldBreakTheFormatDoesNot) {
    const test::ScratchFolder scratch;
    CaptureTags odd = tags();
    odd.patient_name = "A\\B=C\n" + std::string(100, 'x');
    odd.study_description = std::string(63, 'y') + "ää\\";
    odd.side = "both";
    odd.study_utc = "yesterday";
    ASSERT_OK(writeCapture(scratch / "odd.dcm", colours(), odd));
    const Result<DicomFile> file = DicomFile::open(scratch / "odd.dcm");
    ASSERT_OK(file);
    EXPECT_EQ(file->text(kPatientName), "A B C " + std::string(58, 'x'));  // 64 characters
    EXPECT_EQ(file->text(kStudyDescription), std::string(63, 'y') + "ä");  // characters, not bytes
    EXPECT_EQ(file->text(kLaterality), "");
    EXPECT_EQ(file->text(kStudyDate), "");
}

// By hand: the UUID 00112233-4455-8677-8899-aabbccddeeff (version 8, variant 10) is 88962710306278818593693556079980287
// (Python: int("00112233445586778899aabbccddeeff", 16)).
TEST(SecondaryCapture, UidsAreUuidsAsNumbers) {
    EXPECT_EQ(uidFromHash("00112233445566778899aabbccddeeff"), "2.25.88962710306278818593693556079980287");
    EXPECT_EQ(uidFromHash(std::string(32, 'f')).size(), 5 + 39);  // the longest: 44 of 64 characters
    EXPECT_THROW((void)uidFromHash("00112233"), std::logic_error);
}

TEST(SecondaryCapture, NothingIsWrittenWithoutPixels) {
    const test::ScratchFolder scratch;
    EXPECT_FALSE(writeCapture(scratch / "none.dcm", ColorImage(), tags()).ok());
    EXPECT_FALSE(std::filesystem::exists(scratch / "none.dcm"));
}

}  // namespace
}  // namespace fluorocut

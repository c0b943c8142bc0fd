// One DICOM file: its attributes as plain values, and its frames as stored pixel values. DCMTK stays in the .cpp.
//
// Pixel data may be native (little or big endian, deflated), RLE, JPEG baseline, extended and lossless, JPEG-LS (all
// through DCMTK, but for RLE) or JPEG 2000 (through OpenJPEG). Other transfer syntaxes are named in the error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct DicomTag {
    std::uint16_t group;
    std::uint16_t element;
};

namespace tag {
constexpr DicomTag kSopClass{0x0008, 0x0016}, kSopInstance{0x0008, 0x0018}, kImageType{0x0008, 0x0008};
constexpr DicomTag kModality{0x0008, 0x0060}, kManufacturer{0x0008, 0x0070};
constexpr DicomTag kAcquisitionDate{0x0008, 0x0022}, kAcquisitionTime{0x0008, 0x0032};
constexpr DicomTag kAcquisitionDateTime{0x0008, 0x002A};
constexpr DicomTag kContentDate{0x0008, 0x0023}, kContentTime{0x0008, 0x0033};
constexpr DicomTag kSliceThickness{0x0018, 0x0050};
constexpr DicomTag kSourceDetector{0x0018, 0x1110}, kSourcePatient{0x0018, 0x1111};
constexpr DicomTag kImagerPixelSpacing{0x0018, 0x1164};
constexpr DicomTag kPrimaryAngle{0x0018, 0x1510}, kSecondaryAngle{0x0018, 0x1511};
constexpr DicomTag kSeriesInstance{0x0020, 0x000E};
constexpr DicomTag kPosition{0x0020, 0x0032}, kOrientation{0x0020, 0x0037};
constexpr DicomTag kPixelSpacing{0x0028, 0x0030}, kCalibrationType{0x0028, 0x0A02};
constexpr DicomTag kPadding{0x0028, 0x0120}, kPaddingLimit{0x0028, 0x0121};
constexpr DicomTag kRelationship{0x0028, 0x1040}, kRelationshipSign{0x0028, 0x1041};
constexpr DicomTag kIntercept{0x0028, 0x1052}, kSlope{0x0028, 0x1053};
}  // namespace tag

struct DicomPixelFormat {
    int width = 0;
    int height = 0;
    int frames = 1;
    int samples = 1;
    int bits_allocated = 16;
    int bits_stored = 16;
    int high_bit = 15;
    bool is_signed = false;
    bool planar = false;  // colour by plane
    std::string photometric;

    double least() const { return is_signed ? -double(1 << (bits_stored - 1)) : 0.0; }
    double most() const { return is_signed ? double((1 << (bits_stored - 1)) - 1) : double((1 << bits_stored) - 1); }
};

// Stored values v become values[clamp(v - first)].
struct DicomLut {
    int first = 0;
    std::vector<float> values;
};

class DicomFile {
  public:
    static Result<DicomFile> open(const std::filesystem::path& path);
    DicomFile(DicomFile&&) noexcept;
    DicomFile& operator=(DicomFile&&) noexcept;
    ~DicomFile();

    bool has(DicomTag tag) const;          // present with a value
    std::string text(DicomTag tag) const;  // without padding; empty when absent
    // All values of a numeric attribute; empty when absent, NaN for one that is no finite number.
    std::vector<double> numbers(DicomTag tag) const;
    std::optional<double> number(DicomTag tag) const;  // the first one
    std::string transferSyntax() const;
    bool hasPixelData() const;
    bool hasIdentifyingFields() const;

    Result<DicomPixelFormat> pixelFormat() const;
    // Stored values of a frame (from 0), colour interleaved. `format` is this file's.
    Result<std::vector<float>> frame(const DicomPixelFormat& format, int index) const;
    Result<std::optional<DicomLut>> modalityLut(const DicomPixelFormat& format) const;

  private:
    struct Impl;
    explicit DicomFile(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Refuses a file whose sequences nest deeper than any image's, which would exhaust DCMTK's stack.
Result<void> checkDicomNesting(const std::filesystem::path& path);

// RLE: `pixels` times `samples` values of one or two bytes, interleaved, little-endian. False when it is damaged.
bool decodeRle(const std::vector<std::uint8_t>& bytes, std::size_t pixels, std::size_t samples,
               std::size_t bytes_per_sample, std::vector<std::uint8_t>& values);

// A JPEG 2000 codestream (with or without the JP2 boxes) of `samples` components of the given size and at most 16 bits;
// interleaved values. The error's text is what is wrong with it, without the file's name.
struct Jpeg2000Error {
    std::string found;
};
std::optional<Jpeg2000Error> decodeJpeg2000(const std::vector<std::uint8_t>& codestream, int width, int height,
                                            int samples, std::vector<std::int32_t>& values);

}  // namespace fluorocut

// DICOM files made for a test with DCMTK's encoders (and OpenJPEG's), so that what our reader sees is another's work.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut::test {

enum class Syntax {
    implicitLittle,
    explicitLittle,
    explicitBig,
    deflated,
    rle,
    jpegBaseline,
    jpegExtended,
    jpegLossless,
    jpegLosslessSv1,
    jpegLs,
    jpeg2000,
};

struct DicomImage {
    int width = 0;
    int height = 0;
    std::vector<std::uint16_t> pixels;  // bit patterns, frame after frame
    int frames = 1;
    int bits_allocated = 16;
    int bits_stored = 12;
    bool is_signed = false;
    // Any attribute, by group and element, as DICOM text ("0.3\\0.3"); overrides the defaults (MONOCHROME2, XA).
    std::map<std::pair<std::uint16_t, std::uint16_t>, std::string> attributes;
    Syntax syntax = Syntax::explicitLittle;
};

void makeDicom(const std::filesystem::path& path, const DicomImage& image);

// A CT slice: HU of pixel (x, y) at `position` is a function of x, y and `id`.
struct CtSlice {
    int width = 12;
    int height = 10;
    int id = 0;
    Vector3 position = Vector3::Zero();
    Vector3 row = Vector3::UnitX();
    Vector3 column = Vector3::UnitY();
    double between_rows_mm = 0.5;
    double between_columns_mm = 0.75;
    std::string series = "1.2.3.4";
    std::map<std::pair<std::uint16_t, std::uint16_t>, std::string> attributes;
    Syntax syntax = Syntax::explicitLittle;
};
void makeCtSlice(const std::filesystem::path& path, const CtSlice& slice);
float ctValue(int x, int y, int id);  // the HU that makeCtSlice stores

}  // namespace fluorocut::test

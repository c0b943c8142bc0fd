// NIfTI-1 (.nii, .nii.gz; nifti.nimh.nih.gov/nifti-1): a 348-byte header, then the elements. Its patient frame is RAS;
// ours is DICOM LPS, so x and y change sign.
//
// Orientation, as the standard ranks it: the sform matrix when it has a code; else the qform quaternion when it has
// one; else pixdim alone along the RAS axes. A sheared sform gives way to a qform.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHeaderBytes = 348;
constexpr std::size_t kDataOffset = 352;

// Where the fields lie (nifti1.h).
enum Offset : std::size_t {
    kDim = 40,
    kDatatype = 70,
    kBitpix = 72,
    kPixdim = 76,
    kVoxOffset = 108,
    kSclSlope = 112,
    kSclInter = 116,
    kUnits = 123,
    kDescription = 148,
    kQformCode = 252,
    kSformCode = 254,
    kQuaternion = 256,
    kQoffset = 268,
    kSrow = 280,
    kMagic = 344,
};

const Matrix3 kLpsFromRas = Vector3(-1, -1, 1).asDiagonal();

struct Type {
    int code;
    ElementType type;
};
constexpr Type kTypes[] = {
    {2, ElementType::uint8},    {256, ElementType::int8},   {512, ElementType::uint16},  {4, ElementType::int16},
    {768, ElementType::uint32}, {8, ElementType::int32},    {1280, ElementType::uint64}, {1024, ElementType::int64},
    {16, ElementType::float32}, {64, ElementType::float64},
};

// The first bytes of the file's content, inflated where it is compressed.
std::string headerBytes(const fs::path& path, bool& compressed) {
    const Result<std::string> head = readBeginning(path, 2);
    if (!head) return {};
    compressed = head->starts_with("\x1f\x8b");
    Result<ByteReader> reader =
        ByteReader::open(path, 0, compressed ? ByteReader::Encoding::deflate : ByteReader::Encoding::raw);
    if (!reader) return {};
    std::string bytes(kHeaderBytes, '\0');
    bytes.resize(reader->read(bytes.data(), bytes.size()));
    return bytes;
}

class Header {
  public:
    Header(std::string bytes, bool swap) : bytes_(std::move(bytes)), swap_(swap) {}
    int int16(std::size_t offset) const { return get<std::int16_t>(offset); }
    double float32(std::size_t offset) const { return get<float>(offset); }
    Vector3 vector(std::size_t offset) const { return {float32(offset), float32(offset + 4), float32(offset + 8)}; }
    int byte(std::size_t offset) const { return static_cast<unsigned char>(bytes_[offset]); }

  private:
    template <class T>
    T get(std::size_t offset) const {
        char raw[sizeof(T)];
        std::memcpy(raw, bytes_.data() + offset, sizeof(T));
        if (swap_) std::reverse(raw, raw + sizeof(T));
        return std::bit_cast<T>(raw);
    }
    std::string bytes_;
    bool swap_;
};

bool isOrthogonal(const Matrix3& m) {
    Matrix3 unit = m;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(m.col(axis).norm() > 0)) return false;
        unit.col(axis).normalize();
    }
    return (unit.transpose() * unit - Matrix3::Identity()).cwiseAbs().maxCoeff() <= 1e-3;
}

// Matrix (columns: axes times spacing) and origin, RAS, in the file's unit.
Result<void> readOrientation(const fs::path& path, const Header& file, RasterHeader& header) {
    Matrix3 ras = Matrix3::Zero();
    Vector3 origin = Vector3::Zero();
    const Vector3 pixdim = file.vector(kPixdim + 4);
    for (int axis = 0; axis < 3; ++axis) {
        if (!std::isfinite(pixdim[axis])) {
            return invalidInput(fmt::format("{}, header field pixdim[{}]", path.string(), axis + 1),
                                fmt::format("{}", pixdim[axis]), "a finite spacing", "export it again");
        }
    }
    bool have = false;
    if (file.int16(kSformCode) > 0) {
        for (std::size_t row = 0; row < 3; ++row) {
            ras.row(static_cast<Eigen::Index>(row)) = file.vector(kSrow + 16 * row).transpose();
            origin[static_cast<Eigen::Index>(row)] = file.float32(kSrow + 16 * row + 12);
        }
        if (!ras.allFinite() || !origin.allFinite()) {
            return invalidInput(path.string() + ", header field srow", "numbers that are not finite", "a finite matrix",
                                "export it again");
        }
        have = file.int16(kQformCode) <= 0 || isOrthogonal(ras);
        if (!have) header.notes.push_back("the sform matrix is sheared: the qform is used");
    }
    if (!have && file.int16(kQformCode) > 0) {
        const Vector3 bcd = file.vector(kQuaternion);
        const double rest = 1 - bcd.squaredNorm();
        if (!(rest > -1e-3)) {
            return invalidInput(path.string() + ", header field quatern", fmt::format("a norm of {}", bcd.norm()),
                                "at most 1", "export it again");
        }
        const Eigen::Quaterniond q(std::sqrt(std::max(rest, 0.0)), bcd.x(), bcd.y(), bcd.z());
        ras = q.normalized().toRotationMatrix() * pixdim.asDiagonal();
        if (file.float32(kPixdim) < 0) ras.col(2) *= -1;  // qfac: a left-handed grid
        origin = file.vector(kQoffset);
        have = true;
    }
    if (!have) {
        header.notes.push_back("the header does not say how the patient lies (no sform, no qform): axes taken as RAS");
        ras = pixdim.asDiagonal();
    }
    double mm = 1;
    switch (file.byte(kUnits) & 7) {
        case 0:  // not said: millimetres, as everyone takes it
        case 2:
            break;
        case 1:
            mm = 1000;
            header.notes.push_back("lengths in metres, converted");
            break;
        case 3:
            mm = 0.001;
            header.notes.push_back("lengths in micrometres, converted");
            break;
        default:
            return invalidInput(path.string() + ", header field xyzt_units", fmt::format("{}", file.byte(kUnits)),
                                "metres, millimetres or micrometres");
    }
    for (int axis = 0; axis < 3; ++axis) {
        const double norm = ras.col(axis).norm();
        header.spacing_mm[axis] = norm * mm;
        header.direction.col(axis) = norm > 0 ? Vector3(kLpsFromRas * ras.col(axis) / norm) : Vector3::Zero();
        if (std::abs(norm - std::abs(pixdim[axis])) > 0.01 * norm) {
            header.notes.push_back(fmt::format(
                "axis {}: pixdim {} and orientation matrix {} disagree: the matrix is used", axis, pixdim[axis], norm));
        }
    }
    header.origin_mm = kLpsFromRas * origin * mm;
    return {};
}

}  // namespace

bool looksLikeNifti(const fs::path& path) {
    bool compressed = false;
    const std::string bytes = headerBytes(path, compressed);
    if (bytes.size() < 4) return false;
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data(), 4);
    return size == 348 || size == 0x5C010000 || size == 540 || size == 0x1C020000;
}

Result<RasterHeader> readNiftiHeader(const fs::path& path) {
    RasterHeader header;
    header.format = "NIfTI";
    const std::string bytes = headerBytes(path, header.compressed);
    if (bytes.size() < kHeaderBytes) {
        return invalidInput(path.string(), fmt::format("{} bytes", bytes.size()), "a NIfTI header of 348 bytes",
                            "the file is cut short; copy or export it again");
    }
    std::uint32_t declared = 0;
    std::memcpy(&declared, bytes.data(), 4);
    if (declared == 540 || declared == 0x1C020000) {
        return invalidInput(path.string(), "NIfTI-2", "NIfTI-1", "convert it");
    }
    const bool swap = declared != 348;
    const Header file(bytes, swap);
    const std::string_view magic = std::string_view(bytes).substr(kMagic, 4);
    if (magic != std::string_view("n+1\0", 4)) {
        return invalidInput(path.string() + ", header field magic", shown(magic.substr(0, 3)), "n+1",
                            "pairs of .hdr and .img and Analyze files are not read; save it as .nii");
    }
    header.big_endian = swap;

    const int dimensions = file.int16(kDim);
    if (!(dimensions >= 2 && dimensions <= 7)) {
        return invalidInput(path.string() + ", header field dim[0]", fmt::format("{}", dimensions), "2 or 3");
    }
    for (std::size_t axis = 0; axis < static_cast<std::size_t>(dimensions); ++axis) {
        const int size = file.int16(kDim + 2 + 2 * axis);
        if (axis < 3) {
            header.size[axis] = size;
        } else if (size != 1) {
            return invalidInput(fmt::format("{}, header field dim[{}]", path.string(), axis + 1),
                                fmt::format("{}", size), "1", "it holds several volumes: save one of them");
        }
    }
    header.dimensions = std::min(dimensions, 3);

    const int datatype = file.int16(kDatatype);
    const Type* known = nullptr;
    for (const Type& candidate : kTypes) {
        if (candidate.code == datatype) known = &candidate;
    }
    if (!known) {
        return invalidInput(path.string() + ", header field datatype", fmt::format("{}", datatype),
                            "a scalar number type (2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280)");
    }
    header.type = known->type;
    if (file.int16(kBitpix) != static_cast<int>(8 * byteCount(known->type))) {
        return invalidInput(path.string() + ", header field bitpix", fmt::format("{}", file.int16(kBitpix)),
                            fmt::format("{} for datatype {}", 8 * byteCount(known->type), datatype));
    }
    const double offset = file.float32(kVoxOffset);
    if (!(offset >= static_cast<double>(kDataOffset) && offset <= 1e8 && offset == std::floor(offset))) {
        return invalidInput(path.string() + ", header field vox_offset", fmt::format("{}", offset), "at least 352");
    }
    header.data_file = path;
    (header.compressed ? header.inflated_skip : header.data_offset) = static_cast<std::uint64_t>(offset);
    const double slope = file.float32(kSclSlope);
    if (slope != 0) {  // 0: no scaling; NaN is refused by checkRaster
        header.slope = slope;
        header.intercept = file.float32(kSclInter);
    }
    if (Result<void> read = readOrientation(path, file, header); !read) return read.error();
    return header;
}

Result<void> writeNifti(const fs::path& path, const RasterView& raster) {
    if (raster.dimensions != 3) throw std::logic_error("writeNifti: volumes only");
    for (const int size : raster.size) {
        if (size > 32767) {
            return invalidOption(path.string(), fmt::format("{} voxels along an axis", size), "at most 32767 in NIfTI",
                                 "write NRRD or MHA");
        }
    }
    Result<std::string> data = encodeElements(path, *raster.values, raster.type);
    if (!data) return data.error();
    std::string bytes(kDataOffset, '\0');
    const auto put = [&](std::size_t offset, auto value) { std::memcpy(bytes.data() + offset, &value, sizeof(value)); };
    const auto putFloat = [&](std::size_t offset, double value) { put(offset, static_cast<float>(value)); };
    put(0, std::int32_t{348});
    put(kDim, std::int16_t{3});
    for (std::size_t axis = 0; axis < 7; ++axis) {
        put(kDim + 2 + 2 * axis, static_cast<std::int16_t>(axis < 3 ? raster.size[axis] : 1));
        putFloat(kPixdim + 4 + 4 * axis, axis < 3 ? raster.spacing_mm[static_cast<Eigen::Index>(axis)] : 1.0);
    }
    for (const Type& candidate : kTypes) {
        if (candidate.type == raster.type) put(kDatatype, static_cast<std::int16_t>(candidate.code));
    }
    put(kBitpix, static_cast<std::int16_t>(8 * byteCount(raster.type)));
    putFloat(kVoxOffset, kDataOffset);
    putFloat(kSclSlope, 1);
    bytes[kUnits] = 2;  // mm
    put(kSformCode, std::int16_t{1});
    put(kQformCode, std::int16_t{1});
    Matrix3 ras = kLpsFromRas * raster.direction;
    const Vector3 origin = kLpsFromRas * raster.origin_mm;
    for (Eigen::Index row = 0; row < 3; ++row) {
        const std::size_t at = kSrow + 16 * static_cast<std::size_t>(row);
        for (Eigen::Index column = 0; column < 3; ++column) {
            putFloat(at + 4 * static_cast<std::size_t>(column), ras(row, column) * raster.spacing_mm[column]);
        }
        putFloat(at + 12, origin[row]);
        putFloat(kQoffset + 4 * static_cast<std::size_t>(row), origin[row]);
    }
    const bool left_handed = ras.determinant() < 0;
    if (left_handed) ras.col(2) *= -1;
    putFloat(kPixdim, left_handed ? -1 : 1);
    Eigen::Quaterniond q(ras);
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    putFloat(kQuaternion, q.x());
    putFloat(kQuaternion + 4, q.y());
    putFloat(kQuaternion + 8, q.z());
    std::memcpy(bytes.data() + kMagic, "n+1", 4);
    bytes += *data;
    return writeWhole(path, raster.compressed ? deflated(bytes, DeflateWrapper::gzip) : bytes);
}

}  // namespace fluorocut

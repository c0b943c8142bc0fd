// Broken and hostile files: cut short anywhere, bytes changed anywhere, headers that lie. Every reader answers with a
// value or with one sentence about the file; it does not crash, hang or take memory that the file does not justify.
// Mutations are seeded: a failure comes back.
#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <random>

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/geometry/primitives.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/volume_file.h"
#include "tests/core/io/dicom_maker.h"
#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::content;
using test::put;
using ::testing::HasSubstr;

// What a reader says: nothing when it reads the file, else its error.
using Reader = std::function<std::optional<Error>(const fs::path&)>;

template <class T>
std::optional<Error> errorOf(const Result<T>& result) {
    return result ? std::nullopt : std::optional<Error>(result.error());
}
const Reader kImage = [](const fs::path& path) { return errorOf(readImage(path)); };
const Reader kVolume = [](const fs::path& path) { return errorOf(readVolume(path)); };
const Reader kMesh = [](const fs::path& path) { return errorOf(readMesh(path, {LengthUnit::mm, false})); };
const Reader kPose = [](const fs::path& path) { return errorOf(readPose(path)); };

struct Sample {
    std::string name;  // a file name
    Reader read;
    // Bytes at the end that a reader may do without (a trailing block, a newline, the zero that makes a deflated file's
    // length even).
    std::size_t spare = 0;
};

std::vector<Sample> samples() {
    return {{"a.png", kImage},        {"uint16.tif", kImage},      {"raw.mha", kVolume},
            {"packed.mha", kVolume},  {"image.mha", kImage},       {"raw.nrrd", kVolume},
            {"packed.nrrd", kVolume}, {"raw.nii", kVolume},        {"packed.nii.gz", kVolume},
            {"native.dcm", kImage},   {"deflated.dcm", kImage, 1}, {"rle.dcm", kImage},
            {"jpeg.dcm", kImage},     {"baseline.dcm", kImage},    {"jpegls.dcm", kImage},
            {"jpeg2000.dcm", kImage}, {"binary.stl", kMesh},       {"ascii.stl", kMesh, 1},
            {"a.obj", kMesh},         {"ascii.ply", kMesh, 1},     {"binary.ply", kMesh},
            {"pose.json", kPose, 2}};
}

void makeSample(const fs::path& path) {
    const std::string name = path.filename().string();
    const auto require = [](const Result<void>& result) {
        if (!result) throw std::runtime_error(result.error().message());
    };
    Image image(31, 17);
    for (std::size_t i = 0; i < image.size(); ++i)
        image.pixels()[i] = static_cast<float>(i * 97 % 4096);
    VolumeGrid grid;
    grid.size = {9, 7, 5};
    grid.spacing_mm = {0.5, 0.75, 2};
    Volume volume(grid);
    for (std::size_t i = 0; i < volume.voxels().size(); ++i)
        volume.voxels()[i] = static_cast<float>(i * 31 % 3000);
    const std::string extension = path.extension().string();
    if (name == "image.mha" || extension == ".png") {
        ImageWriteOptions options;
        options.type = PixelType::uint16;
        require(writeImage(path, image, options));
    } else if (extension == ".tif") {
        ImageWriteOptions options;
        options.type = PixelType::uint16;
        require(writeImage(path, image, options));
    } else if (extension == ".mha" || extension == ".nrrd" || extension == ".nii" || extension == ".gz") {
        require(writeVolume(path, volume, VolumeWriteOptions{VoxelType::int16, name.starts_with("packed")}));
    } else if (extension == ".dcm") {
        test::DicomImage dicom;
        dicom.width = 31;
        dicom.height = 17;
        dicom.pixels.assign(image.pixels().begin(), image.pixels().end());
        dicom.attributes[{0x0018, 0x1164}] = "0.3\\0.3";
        const std::map<std::string, test::Syntax> syntaxes = {{"native.dcm", test::Syntax::explicitLittle},
                                                              {"deflated.dcm", test::Syntax::deflated},
                                                              {"rle.dcm", test::Syntax::rle},
                                                              {"jpeg.dcm", test::Syntax::jpegLosslessSv1},
                                                              {"baseline.dcm", test::Syntax::jpegBaseline},
                                                              {"jpegls.dcm", test::Syntax::jpegLs},
                                                              {"jpeg2000.dcm", test::Syntax::jpeg2000}};
        dicom.syntax = syntaxes.at(name);
        if (dicom.syntax == test::Syntax::jpegBaseline) {
            dicom.bits_allocated = dicom.bits_stored = 8;
            for (std::uint16_t& pixel : dicom.pixels)
                pixel &= 0xFF;
        }
        makeDicom(path, dicom);
    } else if (name == "binary.stl") {
        require(writeMesh(path, makeSphere(10, 1)));
    } else if (extension == ".json") {
        Pose pose;
        pose.covariance = Matrix6::Identity();
        require(writePose(path, pose));
    } else {
        const TriangleMesh mesh = makeBox({10, 20, 30});
        std::ostringstream text;
        if (extension == ".stl") {
            text << "solid a\n";
            for (const Triangle& t : mesh.triangles) {
                text << "facet normal 0 0 1\nouter loop\n";
                for (const int v : t)
                    text << "vertex " << mesh.vertices[static_cast<std::size_t>(v)].transpose() << "\n";
                text << "endloop\nendfacet\n";
            }
            text << "endsolid\n";
        } else if (extension == ".obj") {
            for (const Vector3& v : mesh.vertices)
                text << "v " << v.transpose() << "\n";
            for (const Triangle& t : mesh.triangles)
                text << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
        } else {
            const bool ascii = name == "ascii.ply";
            text << "ply\nformat " << (ascii ? "ascii" : "binary_little_endian") << " 1.0\nelement vertex "
                 << mesh.vertices.size() << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
                 << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
            for (const Vector3& v : mesh.vertices) {
                const Eigen::Vector3f f = v.cast<float>();
                if (ascii) {
                    text << f.transpose() << "\n";
                } else {
                    text.write(reinterpret_cast<const char*>(f.data()), 12);
                }
            }
            for (const Triangle& t : mesh.triangles) {
                if (ascii) {
                    text << "3 " << t[0] << " " << t[1] << " " << t[2] << "\n";
                } else {
                    text.put(3);
                    text.write(reinterpret_cast<const char*>(t.data()), 12);
                }
            }
        }
        put(path, text.str());
    }
}

void expectASentence(const Error& error, const fs::path& path) {
    EXPECT_EQ(error.code, ErrorCode::invalidInput) << error.message();
    const std::string message = error.message();
    EXPECT_THAT(message, HasSubstr(path.string()));
    EXPECT_LT(message.size(), 700u) << message;
    EXPECT_TRUE(std::all_of(message.begin(), message.end(), [](unsigned char c) { return c >= 32; })) << message;
}

class HostileFile : public testing::TestWithParam<Sample> {};

TEST_P(HostileFile, CutShortAnywhereIsRefusedInWords) {
    const test::ScratchFolder scratch;
    const fs::path whole = scratch / GetParam().name;
    makeSample(whole);
    ASSERT_EQ(GetParam().read(whole), std::nullopt);
    const std::string bytes = content(whole);
    const fs::path cut = scratch / ("cut." + GetParam().name);
    const std::size_t step = std::max<std::size_t>(1, bytes.size() / 150);
    // Every place near both ends, where headers and the last block's end are.
    const auto next = [&](std::size_t size) {
        return size + (size < 200 || size + 32 + step > bytes.size() ? 1 : step);
    };
    for (std::size_t size = 0; size + GetParam().spare < bytes.size(); size = next(size)) {
        put(cut, std::string_view(bytes).substr(0, size));
        const std::optional<Error> error = GetParam().read(cut);
        // An OBJ is a list without an end: cut between faces it is a smaller mesh.
        if (!error && GetParam().name == "a.obj") continue;
        ASSERT_TRUE(error.has_value()) << "read " << size << " of " << bytes.size() << " bytes as if they were all";
        expectASentence(*error, cut);
    }
}

std::string mutated(std::string bytes, std::mt19937& random) {
    const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
    const std::size_t changes = 1 + below(3);
    for (std::size_t change = 0; change < changes && bytes.size() > 8; ++change) {
        // half of the changes hit the first bytes, where headers are
        const std::size_t at = below(2) ? below(std::min<std::size_t>(bytes.size(), 512)) : below(bytes.size());
        static constexpr std::uint32_t kExtremes[] = {0, 1, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
        switch (below(7)) {
            case 0:
                bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
                break;
            case 1:
                bytes[at] = static_cast<char>(below(256));
                break;
            case 2: {
                const std::uint32_t value = kExtremes[below(std::size(kExtremes))];
                std::memcpy(bytes.data() + std::min(at, bytes.size() - 4), &value, 4);
                break;
            }
            case 3:
                bytes.erase(at, 1 + below(16));
                break;
            case 4:
                bytes.insert(at, bytes.substr(at, 1 + below(16)));
                break;
            case 5: {  // a number in a text header becomes another
                const std::size_t digit = bytes.find_first_of("0123456789", at);
                static constexpr std::string_view kNumbers[] = {"9999999999", "-1", "nan", "1e999", "0", "4294967296"};
                if (digit != std::string::npos) bytes.replace(digit, 1, kNumbers[below(std::size(kNumbers))]);
                break;
            }
            default:
                std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), std::min(bytes.size() - at, 1 + below(32)),
                            static_cast<char>(below(2) ? 0xFF : 0));
        }
    }
    return bytes;
}

std::size_t peakMemory() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
        if (line.starts_with("VmHWM:")) return static_cast<std::size_t>(std::stoull(line.substr(6))) * 1024;
    }
    return 0;
}

void readMutations(const Sample& sample, int count, unsigned seed) {
    const test::ScratchFolder scratch;
    makeSample(scratch / sample.name);
    const std::string bytes = content(scratch / sample.name);
    const fs::path path = scratch / ("mutated." + sample.name);
    std::mt19937 random(seed);
    int refused = 0;
    const std::size_t before = peakMemory();
    for (int i = 0; i < count; ++i) {
        put(path, mutated(bytes, random));
        const std::optional<Error> error = sample.read(path);
        if (error) {
            ++refused;
            expectASentence(*error, path);
        }
        if (testing::Test::HasFailure()) {
            fs::copy_file(path, fs::temp_directory_path() / path.filename(), fs::copy_options::overwrite_existing);
            FAIL() << "mutation " << i << " is kept as " << fs::temp_directory_path() / path.filename();
        }
    }
    EXPECT_GT(refused, 20) << "the mutations do not reach what is checked";
    // files of a few kilobytes; a compressed DICOM frame may be blank and is allowed 64 MB of pixels
    EXPECT_LT(peakMemory() - before, 600u << 20);
}

TEST_P(HostileFile, MutationsAreReadOrRefusedInWords) {
    readMutations(GetParam(), 300, 1);
}

TEST_P(HostileFile, SlowMutationsAreReadOrRefusedInWords) {
    readMutations(GetParam(), 2000, 2);
}

INSTANTIATE_TEST_SUITE_P(Formats, HostileFile, testing::ValuesIn(samples()), [](const auto& test) {
    std::string name = test.param.name;
    std::replace(name.begin(), name.end(), '.', '_');
    return name;
});

TEST(HostilePathTest, WhatIsNoReadableFileIsNamed) {
    const test::ScratchFolder scratch;
    put(scratch / "empty.mha", "");
    put(scratch / "locked.mha", "NDims = 3\n");
    put(scratch / "garbage.nrrd", "these are no pixels at all, but words");
    fs::create_directory(scratch / "folder");
    ASSERT_EQ(::mkfifo((scratch / "pipe.png").c_str(), 0600), 0);
    ::chmod((scratch / "locked.mha").c_str(), 0);
    const auto message = [&](const Reader& read, const std::string& name) {
        const std::optional<Error> error = read(scratch / name);
        EXPECT_TRUE(error.has_value()) << name;
        if (!error) return std::string();
        expectASentence(*error, scratch / name);
        return error->message();
    };
    for (const Reader& read : {kImage, kVolume, kMesh, kPose}) {
        EXPECT_THAT(message(read, "missing.mha"), HasSubstr("no such file"));
        EXPECT_THAT(message(read, "empty.mha"), HasSubstr("empty file"));
        EXPECT_THAT(message(read, "pipe.png"), HasSubstr("device or pipe"));
        message(read, "folder");
        message(read, "garbage.nrrd");
        if (::geteuid() != 0) {  // root may read everything
            EXPECT_THAT(message(read, "locked.mha"), HasSubstr("permission"));
        }
        const std::string through_a_file = message(read, "garbage.nrrd/x.png");
        EXPECT_THAT(through_a_file, HasSubstr("ot a directory"));
    }
}

TEST(HostilePathTest, TheContentDecidesNotTheExtension) {
    const test::ScratchFolder scratch;
    makeSample(scratch / "raw.mha");
    fs::rename(scratch / "raw.mha", scratch / "volume.nii.gz");
    EXPECT_EQ(kVolume(scratch / "volume.nii.gz"), std::nullopt);
    makeSample(scratch / "a.png");
    fs::rename(scratch / "a.png", scratch / "image.dcm");
    EXPECT_EQ(kImage(scratch / "image.dcm"), std::nullopt);
    const std::optional<Error> error = kVolume(scratch / "image.dcm");
    ASSERT_TRUE(error);
    EXPECT_THAT(error->message(), HasSubstr("found PNG, expected a volume"));
    EXPECT_TRUE(kMesh(scratch / "image.dcm"));
}

std::string metaHeader(const std::string& changes) {
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\n" + changes + "ElementDataFile = LOCAL\n";
}

TEST(LyingHeaderTest, DeclaredSizesAreCheckedBeforeMemoryIsTaken) {
    const test::ScratchFolder scratch;
    const auto message = [&](const Reader& read, const std::string& name, const std::string& bytes) {
        put(scratch / name, bytes);
        const std::optional<Error> error = read(scratch / name);
        EXPECT_TRUE(error.has_value()) << bytes.substr(0, 200);
        if (!error) return std::string();
        expectASentence(*error, scratch / name);
        return error->message();
    };
    const std::size_t before = peakMemory();
    const std::string data(4096, '\1');
    for (const char* packed : {"", "CompressedData = True\n"}) {
        for (const char* size : {"100000 100000 100000", "1024 1024 1024", "0 4 4", "-4 4 4", "4 4", "4 4 4 4",
                                 "99999999999999999999 1 1", "4.5 4 4"}) {
            message(kVolume, "a.mha",
                    metaHeader(std::string("ElementType = MET_SHORT\nElementSpacing = 1 1 1\nDimSize = ") + size +
                               "\n" + packed) +
                        data);
        }
    }
    const std::string small = "DimSize = 4 4 4\nElementType = MET_SHORT\n";
    EXPECT_THAT(message(kVolume, "a.mha", metaHeader(small) + data), HasSubstr("no voxel spacing"));
    for (const char* spacing : {"nan 1 1", "0 1 1", "-1 1 1", "1e9 1 1", "inf 1 1", "1 1", "x 1 1"}) {
        message(kVolume, "a.mha", metaHeader(small + "ElementSpacing = " + spacing + "\n") + data);
    }
    const std::string placed = small + "ElementSpacing = 1 1 1\n";
    for (const char* matrix : {"1 0 0 0 1 0 0 0 0", "1 1 0 0 1 0 0 0 1", "2 0 0 0 1 0 0 0 1", "nan 0 0 0 1 0 0 0 1"}) {
        message(kVolume, "a.mha", metaHeader(placed + "TransformMatrix = " + matrix + "\n") + data);
    }
    message(kVolume, "a.mha", metaHeader(placed + "Offset = nan 0 0\n") + data);
    message(kVolume, "a.mha", metaHeader(placed + "ElementNumberOfChannels = 3\n") + data);
    message(kVolume, "a.mhd", "ObjectType = Image\nNDims = 3\n" + placed + "ElementDataFile = missing.raw\n");
    message(kVolume, "a.mhd", "ObjectType = Image\nNDims = 3\n" + placed + "ElementDataFile = LIST\n");

    const std::string nrrd = "NRRD0004\ntype: short\nendian: little\ndimension: 3\nspace: LPS\nspace origin: (0,0,0)\n";
    const std::string directions = "space directions: (1,0,0) (0,1,0) (0,0,1)\n";
    for (const char* encoding : {"encoding: raw\n", "encoding: gzip\n"}) {
        for (const char* size : {"100000 100000 100000", "1024 1024 1024", "0 1 1", "-1 1 1", "1 1"}) {
            message(kVolume, "a.nrrd", nrrd + directions + encoding + "sizes: " + size + "\n\n" + data);
        }
    }
    for (const char* bad : {"(nan,0,0) (0,1,0) (0,0,1)", "(0,0,0) (0,1,0) (0,0,1)", "(1,0,0) (1,0,0) (0,0,1)",
                            "(1,0) (0,1) (0,0)", "none (0,1,0) (0,0,1)", "(1,0,0)"}) {
        message(kVolume, "a.nrrd", nrrd + "encoding: raw\nsizes: 4 4 4\nspace directions: " + bad + "\n\n" + data);
    }

    makeSample(scratch / "good.nii");
    const std::string good = content(scratch / "good.nii");
    const auto nifti = [&](std::size_t offset, auto value) {
        std::string bytes = good;
        std::memcpy(bytes.data() + offset, &value, sizeof value);
        return message(kVolume, "a.nii", bytes);
    };
    EXPECT_THAT(nifti(40, std::int16_t{2}), HasSubstr("2 dimensions"));
    nifti(40, std::int16_t{0});
    nifti(42, std::int16_t{0});
    nifti(42, std::int16_t{-5});
    EXPECT_THAT(nifti(42, std::int16_t{32767}), HasSubstr("bytes of data"));
    EXPECT_THAT(nifti(70, std::int16_t{128}), HasSubstr("datatype"));
    EXPECT_THAT(nifti(72, std::int16_t{8}), HasSubstr("bitpix"));
    EXPECT_THAT(nifti(80, NAN), HasSubstr("pixdim[1]"));
    nifti(108, -1.f);
    nifti(108, NAN);
    EXPECT_THAT(nifti(112, NAN), HasSubstr("slope"));
    put(scratch / "sheared.nii", std::string(good).replace(284, 4, std::string("\0\0\x40\x40", 4)));  // srow_x[1] = 3
    EXPECT_EQ(kVolume(scratch / "sheared.nii"), std::nullopt);  // the qform stands in
    nifti(284, NAN);
    EXPECT_THAT(nifti(344, 'x'), HasSubstr("magic"));

    makeSample(scratch / "good.png");
    std::string png = content(scratch / "good.png");
    png[16] = 0, png[17] = 1, png[18] = '\x86', png[19] = '\xa0';  // 100000 columns; the CRC no longer agrees either
    message(kImage, "a.png", png);

    // memory stays what small files justify
    EXPECT_LT(peakMemory() - before, 64u << 20);
}

TEST(LyingHeaderTest, DicomRowsColumnsAndFramesMustFitThePixelData) {
    const test::ScratchFolder scratch;
    const auto message = [&](std::uint16_t group, std::uint16_t element, const std::string& value,
                             test::Syntax syntax = test::Syntax::explicitLittle) {
        test::DicomImage image;
        image.width = image.height = 8;
        image.pixels.assign(64, 100);
        image.syntax = syntax;
        makeDicom(scratch / "good.dcm", image);
        // the attribute is changed after the encoder has seen the true one: all US values of the header are 2 bytes
        std::string bytes = content(scratch / "good.dcm");
        const char tag[] = {static_cast<char>(group & 0xFF),
                            static_cast<char>(group >> 8),
                            static_cast<char>(element & 0xFF),
                            static_cast<char>(element >> 8),
                            'U',
                            'S',
                            2,
                            0};
        const std::size_t at = bytes.find(std::string_view(tag, 8));
        if (at == std::string::npos) throw std::logic_error("attribute not found");
        const auto number = static_cast<std::uint16_t>(std::stoi(value));
        std::memcpy(bytes.data() + at + 8, &number, 2);
        put(scratch / "a.dcm", bytes);
        const std::optional<Error> error = kImage(scratch / "a.dcm");
        EXPECT_TRUE(error.has_value()) << value;
        if (!error) return std::string();
        expectASentence(*error, scratch / "a.dcm");
        return error->message();
    };
    EXPECT_THAT(message(0x28, 0x10, "9"), HasSubstr("128 bytes for 1 frames of 8 x 9"));
    message(0x28, 0x10, "0");
    message(0x28, 0x10, "65535");
    message(0x28, 0x11, "65535");
    for (const test::Syntax syntax :
         {test::Syntax::rle, test::Syntax::jpegLosslessSv1, test::Syntax::jpegLs, test::Syntax::jpeg2000}) {
        message(0x28, 0x10, "65535", syntax);
        message(0x28, 0x11, "9", syntax);
    }
    EXPECT_THAT(message(0x28, 0x100, "32"), HasSubstr("BitsAllocated"));
    EXPECT_THAT(message(0x28, 0x101, "17"), HasSubstr("BitsStored"));
    EXPECT_THAT(message(0x28, 0x102, "3"), HasSubstr("HighBit"));
    EXPECT_THAT(message(0x28, 0x2, "7"), HasSubstr("7 samples"));
}

TEST(LyingHeaderTest, TransferSyntaxesThatCannotBeReadAreNamed) {
    const test::ScratchFolder scratch;
    test::DicomImage image;
    image.width = image.height = 8;
    image.pixels.assign(64, 100);
    image.syntax = test::Syntax::jpeg2000;
    makeDicom(scratch / "a.dcm", image);
    std::string bytes = content(scratch / "a.dcm");
    const std::size_t at = bytes.find("1.2.840.10008.1.2.4.90");
    ASSERT_NE(at, std::string::npos);
    bytes.replace(at, 22, std::string("1.2.840.10008.1.2.4.102\0", 24));  // MPEG-4 AVC/H.264
    bytes[at - 2] = 24;                                                   // the value's length, and the group's
    bytes[140] = static_cast<char>(bytes[140] + 2);
    put(scratch / "b.dcm", bytes);
    const std::optional<Error> error = kImage(scratch / "b.dcm");
    ASSERT_TRUE(error);
    expectASentence(*error, scratch / "b.dcm");
    EXPECT_THAT(error->message(), HasSubstr("MPEG-4 AVC/H.264"));
    EXPECT_THAT(error->message(), HasSubstr("export it uncompressed"));
}

// Sequences within sequences: a parser that calls itself for each would run out of stack.
TEST(LyingHeaderTest, DicomSequencesNestedWithoutEndAreRefused) {
    const test::ScratchFolder scratch;
    test::DicomImage image;
    image.width = image.height = 8;
    image.pixels.assign(64, 100);
    image.syntax = test::Syntax::explicitLittle;
    makeDicom(scratch / "a.dcm", image);
    std::string bytes = content(scratch / "a.dcm");
    const std::size_t at = bytes.find(std::string_view("\x18\x00\x64\x11", 4));
    const std::size_t where = at == std::string::npos ? bytes.find(std::string_view("\x28\x00\x02\x00", 4)) : at;
    ASSERT_NE(where, std::string::npos);
    // (0009,1001) SQ of undefined length, item of undefined length, and so on
    const std::string level("\x09\x00\x01\x10SQ\x00\x00\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff", 20);
    std::string nested;
    for (int i = 0; i < 400000; ++i)
        nested += level;
    put(scratch / "b.dcm", bytes.substr(0, where) + nested);
    const std::optional<Error> error = kImage(scratch / "b.dcm");
    ASSERT_TRUE(error);
    expectASentence(*error, scratch / "b.dcm");
}

// GDCM's Debian version has open memory-safety holes: nothing that reads files may bring it in.
TEST(LinkedLibrariesTest, GdcmIsNotAmongThem) {
    const std::string maps = content("/proc/self/maps");
    EXPECT_THAT(maps, HasSubstr("libdcmdata"));  // the list is the one that is looked for
    EXPECT_THAT(maps, testing::Not(HasSubstr("libgdcm")));
}

}  // namespace
}  // namespace fluorocut

// Our readers and writers of MetaImage, NRRD and NIfTI against ITK's: an oblique, anisotropic, also left-handed volume
// written by one and read by the other lies at the same points of LPS space with the same voxels.
#include <algorithm>

#include <gtest/gtest.h>
#include <itkImage.h>
#include <itkImageFileReader.h>
#include <itkImageFileWriter.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include "core/io/volume_file.h"
#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::obliqueVolume;
using ItkImage = itk::Image<float, 3>;

// ITK's factories are left out (one of them would bring GDCM): the reader is told its format.
itk::ImageIOBase::Pointer formatOf(const fs::path& path) {
    if (path.extension() == ".mha") return itk::MetaImageIO::New().GetPointer();
    if (path.extension() == ".nrrd") return itk::NrrdImageIO::New().GetPointer();
    return itk::NiftiImageIO::New().GetPointer();
}

ItkImage::Pointer readWithItk(const fs::path& path) {
    auto reader = itk::ImageFileReader<ItkImage>::New();
    reader->SetImageIO(formatOf(path));
    reader->SetFileName(path.string());
    reader->Update();
    return reader->GetOutput();
}

void writeWithItk(const fs::path& path, const Volume& volume, bool compressed) {
    auto image = ItkImage::New();
    const VolumeGrid& grid = volume.grid();
    ItkImage::SizeType size;
    ItkImage::SpacingType spacing;
    ItkImage::PointType origin;
    ItkImage::DirectionType direction;
    for (unsigned i = 0; i < 3; ++i) {
        size[i] = static_cast<itk::SizeValueType>(grid.size[i]);
        spacing[i] = grid.spacing_mm[i];
        origin[i] = grid.origin_mm[i];
        for (unsigned j = 0; j < 3; ++j)
            direction[i][j] = grid.direction(i, j);
    }
    image->SetRegions(size);
    image->SetSpacing(spacing);
    image->SetOrigin(origin);
    image->SetDirection(direction);
    image->Allocate();
    std::copy(volume.voxels().begin(), volume.voxels().end(), image->GetBufferPointer());
    auto writer = itk::ImageFileWriter<ItkImage>::New();
    writer->SetImageIO(formatOf(path));
    writer->SetFileName(path.string());
    writer->SetUseCompression(compressed);
    writer->SetInput(image);
    writer->Update();
}

class ItkComparison : public testing::TestWithParam<const char*> {};

TEST_P(ItkComparison, ItkReadsWhatWeWrite) {
    const test::ScratchFolder scratch;
    const fs::path path = scratch / (std::string("v") + GetParam());
    for (const bool left_handed : {false, true}) {
        const Volume volume = obliqueVolume(left_handed);
        for (const VoxelType type : {VoxelType::int16, VoxelType::float32}) {
            for (const bool compressed : {false, true}) {
                ASSERT_OK(writeVolume(path, volume, VolumeWriteOptions{type, compressed}));
                const ItkImage::Pointer image = readWithItk(path);
                for (int k = 0; k < 4; ++k) {
                    for (int j = 0; j < 5; ++j) {
                        for (int i = 0; i < 7; ++i) {
                            const ItkImage::IndexType index{{i, j, k}};
                            ASSERT_EQ(image->GetPixel(index), volume(i, j, k));
                            ItkImage::PointType point;
                            image->TransformIndexToPhysicalPoint(index, point);
                            const Vector3 ours = volume.grid().pointFromIndex(Vector3(i, j, k));
                            // NIfTI holds floats: 1000 mm to 6e-5; the others every digit
                            ASSERT_LT((Vector3(point[0], point[1], point[2]) - ours).norm(), 5e-4);
                        }
                    }
                }
            }
        }
    }
}

TEST_P(ItkComparison, WeReadWhatItkWrites) {
    const test::ScratchFolder scratch;
    const fs::path path = scratch / (std::string("v") + GetParam());
    for (const bool left_handed : {false, true}) {
        const Volume volume = obliqueVolume(left_handed);
        for (const bool compressed : {false, true}) {
            writeWithItk(path, volume, compressed);
            const Result<VolumeFile> read = readVolume(path);
            ASSERT_OK(read);
            EXPECT_EQ(read->volume.voxels(), volume.voxels());
            for (const Vector3& index : {Vector3(0, 0, 0), Vector3(6, 0, 0), Vector3(0, 4, 0), Vector3(0, 0, 3)}) {
                EXPECT_LT((read->volume.grid().pointFromIndex(index) - volume.grid().pointFromIndex(index)).norm(),
                          5e-4);
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Formats, ItkComparison, testing::Values(".mha", ".nrrd", ".nii", ".nii.gz"),
                         [](const auto& test) {
                             std::string name = std::string(test.param).substr(1);
                             std::replace(name.begin(), name.end(), '.', '_');
                             return name;
                         });

TEST(ItkComparisonTest, ARealCtIsTheSameVolumeForBoth) {
    SKIP_WITHOUT_SHARED_DATA();
    for (const char* name : {"ct/femur_m3_left_0.8mm.nii.gz", "ct/tcga_09_2043_right_hip_crop.nii.gz"}) {
        const fs::path path = test::sharedData() / name;
        const Result<VolumeFile> ours = readVolume(path);
        ASSERT_OK(ours);
        const ItkImage::Pointer image = readWithItk(path);
        const std::vector<float>& voxels = ours->volume.voxels();
        ASSERT_EQ(image->GetBufferedRegion().GetNumberOfPixels(), voxels.size());
        EXPECT_TRUE(std::equal(voxels.begin(), voxels.end(), image->GetBufferPointer()));
        const ItkImage::IndexType index{{10, 20, 30}};
        ItkImage::PointType point;
        image->TransformIndexToPhysicalPoint(index, point);
        const Vector3 here = ours->volume.grid().pointFromIndex(Vector3(10, 20, 30));
        EXPECT_LT((Vector3(point[0], point[1], point[2]) - here).norm(), 1e-3);
    }
}

}  // namespace
}  // namespace fluorocut

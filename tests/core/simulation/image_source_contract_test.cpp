// The contract of core/imaging/image_source.h, over every implementation. A new one is added to the list at the end.
#include <cmath>
#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "core/imaging/file_image_source.h"
#include "core/imaging/watched_folder.h"
#include "core/simulation/virtual_operating_room.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

struct Entry {
    std::string name;
    std::function<std::unique_ptr<ImageSource>(const test::ScratchFolder&)> make;

    friend void PrintTo(const Entry& entry, std::ostream* stream) { *stream << entry.name; }
};

class ImageSourceContract : public testing::TestWithParam<Entry> {
  protected:
    void SetUp() override {
        source_ = GetParam().make(scratch_);
        ASSERT_NE(source_, nullptr);
    }

    test::ScratchFolder scratch_;
    std::unique_ptr<ImageSource> source_;
};

class Recorder final : public Progress {
  public:
    explicit Recorder(bool cancels) : cancels_(cancels) {}
    void report(double fraction, std::string_view) override {
        EXPECT_GE(fraction, last);
        EXPECT_LE(fraction, 1);
        last = fraction;
    }
    bool isCancelled() const override { return cancels_; }
    double last = 0;

  private:
    bool cancels_;
};

TEST_P(ImageSourceContract, HandsOverAnImageAndSaysWhereItIsFrom) {
    Recorder progress(false);
    const auto acquired = source_->acquire({}, progress);
    ASSERT_OK(acquired);
    EXPECT_EQ(progress.last, 1);
    EXPECT_FALSE(acquired->image.empty());
    for (const float value : acquired->image.pixels())
        ASSERT_TRUE(std::isfinite(value));
    EXPECT_FALSE(source_->name().empty());
    EXPECT_EQ(acquired->provenance.source, source_->name());
    EXPECT_FALSE(acquired->provenance.identity.empty());
}

TEST_P(ImageSourceContract, WhatItKnowsIsConsistent) {
    const auto acquired = source_->acquire({}, Progress::none());
    ASSERT_OK(acquired);
    if (acquired->nominal_carm) {
        EXPECT_OK(acquired->nominal_carm->validate());
        EXPECT_EQ(acquired->nominal_carm->columns, acquired->image.width());
        EXPECT_EQ(acquired->nominal_carm->rows, acquired->image.height());
        EXPECT_EQ(acquired->nominal_carm->distortion, nullptr) << "a nominal C-arm bends nothing";
    }
    if (acquired->pixel_spacing) {
        EXPECT_GT(acquired->pixel_spacing->mm.minCoeff(), 0);
    }
    if (acquired->source_detector_mm) {
        EXPECT_GT(*acquired->source_detector_mm, 0);
    }
    if (acquired->nominal_position) {
        EXPECT_OK(acquired->nominal_position->validate());
    }
}

TEST_P(ImageSourceContract, CountsItsAcquisitions) {
    const auto first = source_->acquire({}, Progress::none());
    const auto second = source_->acquire({}, Progress::none());
    ASSERT_OK(first);
    ASSERT_OK(second);
    EXPECT_EQ(first->provenance.sequence, 0u);
    EXPECT_EQ(second->provenance.sequence, 1u);
    if (source_->capabilities().repeatable) {
        EXPECT_EQ(first->image, second->image);
        EXPECT_EQ(first->provenance.identity, second->provenance.identity);
    } else {
        EXPECT_NE(first->provenance.identity, second->provenance.identity);
    }
}

TEST_P(ImageSourceContract, RefusesWhatItCannotDo) {
    const ImageSourceCapabilities can = source_->capabilities();
    ImageRequest request;
    request.position = CArmPosition{0.3, 0.1, Vector3::Zero()};
    if (can.moves) {
        EXPECT_OK(source_->acquire(request, Progress::none()));
    } else {
        EXPECT_EQ(source_->acquire(request, Progress::none()).error().code, ErrorCode::invalidOption);
    }
    request.position->orbital_rad = NAN;
    EXPECT_EQ(source_->acquire(request, Progress::none()).error().code, ErrorCode::invalidOption);
    if (can.frames > 0) {
        for (const int frame : {-1, 0, can.frames + 1})
            EXPECT_EQ(source_->acquire({std::nullopt, frame}, Progress::none()).error().code, ErrorCode::invalidOption);
        EXPECT_OK(source_->acquire({std::nullopt, can.frames}, Progress::none()));
    }
}

TEST_P(ImageSourceContract, CanBeCancelledAndUsedAgain) {
    Recorder cancelling(true);
    const auto stopped = source_->acquire({}, cancelling);
    ASSERT_FALSE(stopped.ok());
    EXPECT_TRUE(stopped.error().isCancelled());
    const auto after = source_->acquire({}, Progress::none());
    ASSERT_OK(after);
    EXPECT_EQ(after->provenance.sequence, 0u);
}

// ---------------------------------------------------------------------------------------------------- the list

std::unique_ptr<ImageSource> fileSource(const test::ScratchFolder& scratch, const std::string& name) {
    Image image(24, 16, 7.0f);
    image(3, 4) = 100;
    const auto path = scratch / name;
    if (!writeImage(path, image)) return nullptr;
    auto source = FileImageSource::open(path);
    return source ? std::make_unique<FileImageSource>(std::move(*source)) : nullptr;
}

// Three pictures that have arrived, settled a moment later.
std::unique_ptr<ImageSource> watched(const test::ScratchFolder& scratch) {
    for (const char* name : {"a.dcm", "b.dcm", "c.dcm"})
        if (!fileSource(scratch, name)) return nullptr;
    WatchedFolderOptions options;
    options.take_present = true;
    options.settle = std::chrono::milliseconds(20);
    auto source = WatchedFolder::open(scratch.path(), options);
    return source ? std::make_unique<WatchedFolder>(std::move(*source)) : nullptr;
}

std::unique_ptr<ImageSource> room(const test::ScratchFolder&) {
    VolumeGrid grid;
    grid.size = {20, 20, 20};
    grid.spacing_mm = {4, 4, 4};
    OperatingRoomOptions options;
    options.nominal_carm.columns = options.nominal_carm.rows = 64;
    options.nominal_carm.pixel_mm = {2.56, 2.56};
    options.nominal_carm.principal_point_px = {31.5, 31.5};
    auto made = VirtualOperatingRoom::create(std::make_shared<Volume>(grid, 300.0f), options);
    return made ? std::make_unique<VirtualOperatingRoom>(std::move(*made)) : nullptr;
}

INSTANTIATE_TEST_SUITE_P(Sources, ImageSourceContract,
                         testing::Values(Entry{"PngFile", [](const auto& s) { return fileSource(s, "view.png"); }},
                                         Entry{"TiffFile", [](const auto& s) { return fileSource(s, "view.tif"); }},
                                         Entry{"DicomFile", [](const auto& s) { return fileSource(s, "view.dcm"); }},
                                         Entry{"MetaImageFile",
                                               [](const auto& s) { return fileSource(s, "view.mha"); }},
                                         Entry{"WatchedFolder", watched}, Entry{"VirtualOperatingRoom", room}),
                         [](const auto& entry) { return entry.param.name; });

}  // namespace
}  // namespace fluorocut

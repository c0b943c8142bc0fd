#include "core/imaging/watched_folder.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "core/io/image_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// Fast enough for a test; slow enough for a machine that has much else to do.
WatchedFolderOptions quick() {
    WatchedFolderOptions options;
    options.settle = 150ms;
    options.patience = 700ms;
    options.look_every = 10ms;
    return options;
}

std::string bytesOf(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

void put(const fs::path& path, std::string_view content) {
    std::ofstream(path, std::ios::binary) << content;
}

class After final : public Progress {
  public:
    explicit After(std::chrono::milliseconds wait) : until_(std::chrono::steady_clock::now() + wait) {}
    void report(double, std::string_view) override {}
    bool isCancelled() const override { return std::chrono::steady_clock::now() > until_; }

  private:
    std::chrono::steady_clock::time_point until_;
};

class WatchedFolderTest : public testing::Test {
  protected:
    WatchedFolderTest() {
        fs::create_directory(scratch_ / "out");
        fs::create_directory(scratch_ / "in");
    }
    // A picture's bytes, told apart by its first pixel.
    std::string picture(float mark, const std::string& extension = ".dcm") {
        Image image(40, 30, 100.0f);
        image(0, 0) = mark;
        const fs::path path = scratch_ / ("out/made" + extension);
        EXPECT_OK(writeImage(path, image));
        return bytesOf(path);
    }
    // The same DICOM file with a time of its content: two elements put where they belong, before the first that
    // follows them (ConversionType or Modality; explicit little endian).
    static std::string at(std::string dicom, const std::string& time) {
        const std::size_t place = std::min(dicom.find(std::string("\x08\x00\x60\x00", 4) + "CS"),
                                           dicom.find(std::string("\x08\x00\x64\x00", 4) + "CS"));
        if (place == std::string::npos) throw std::runtime_error("neither Modality nor ConversionType");
        return dicom.insert(place, std::string("\x08\x00\x23\x00"
                                               "DA\x08\x00"
                                               "20260301"
                                               "\x08\x00\x33\x00"
                                               "TM\x06\x00",
                                               24) +
                                       time);
    }
    WatchedFolder watch(const WatchedFolderOptions& options = quick()) {
        return std::move(*WatchedFolder::open(scratch_ / "in", options));
    }
    static float markOf(const Result<AcquiredImage>& acquired) {
        EXPECT_OK(acquired);
        return acquired ? acquired->image(0, 0) : -1;
    }
    fs::path in(const std::string& name) { return scratch_ / "in" / name; }

    test::ScratchFolder scratch_;
};

TEST_F(WatchedFolderTest, HandsOverWhatComesAndNotWhatWasThere) {
    put(in("old.dcm"), picture(1));
    WatchedFolder folder = watch();
    put(in("new.dcm"), picture(2));
    const auto acquired = folder.acquire({}, Progress::none());
    EXPECT_EQ(markOf(acquired), 2);
    EXPECT_EQ(acquired->provenance.identity, in("new.dcm").string());
    After soon(400ms);
    const auto none = folder.acquire({}, soon);
    ASSERT_FALSE(none.ok());
    EXPECT_TRUE(none.error().isCancelled());
}

// Ten pieces with pauses of less than `settle`, and one of more: half a file is never handed over, nor told as bad.
TEST_F(WatchedFolderTest, WaitsForAFileThatIsWrittenSlowlyInPieces) {
    WatchedFolder folder = watch();
    const std::string whole = picture(7);
    std::atomic<bool> written = false;
    std::thread writer([&] {
        std::ofstream stream(in("slow.dcm"), std::ios::binary);
        for (std::size_t piece = 0; piece < 10; ++piece) {
            const std::size_t from = whole.size() * piece / 10, to = whole.size() * (piece + 1) / 10;
            stream.write(whole.data() + from, static_cast<std::streamsize>(to - from));
            stream.flush();
            std::this_thread::sleep_for(piece == 5 ? 400ms : 50ms);
        }
        written = true;
    });
    const auto acquired = folder.acquire({}, Progress::none());
    EXPECT_TRUE(written);
    writer.join();
    EXPECT_EQ(markOf(acquired), 7);
    EXPECT_EQ(acquired->image.height(), 30);
}

TEST_F(WatchedFolderTest, TakesARenamedFileWhenItHasItsName) {
    WatchedFolder folder = watch();
    put(in("picture.dcm.part"), picture(3));
    After soon(400ms);
    EXPECT_TRUE(folder.acquire({}, soon).error().isCancelled());
    fs::rename(in("picture.dcm.part"), in("picture.dcm"));
    EXPECT_EQ(markOf(folder.acquire({}, Progress::none())), 3);
}

TEST_F(WatchedFolderTest, OrdersByTheTimeOfTheExposureNotOfWriting) {
    WatchedFolder folder = watch();
    put(in("a.dcm"), at(picture(3), "103000"));
    put(in("b.dcm"), at(picture(1), "090000"));
    put(in("c.dcm"), at(picture(2), "093000"));
    std::vector<float> marks;
    for (int i = 0; i < 3; ++i)
        marks.push_back(markOf(folder.acquire({}, Progress::none())));
    EXPECT_EQ(marks, (std::vector<float>{1, 2, 3}));
}

TEST_F(WatchedFolderTest, TakesEachPictureOnceAlsoUnderTwoNames) {
    WatchedFolder folder = watch();
    const std::string bytes = picture(4);
    put(in("a.dcm"), bytes);
    EXPECT_EQ(markOf(folder.acquire({}, Progress::none())), 4);
    put(in("copy of a.dcm"), bytes);
    put(in("b.png"), picture(5, ".png"));
    EXPECT_EQ(markOf(folder.acquire({}, Progress::none())), 5);
    After soon(400ms);
    EXPECT_TRUE(folder.acquire({}, soon).error().isCancelled());
}

TEST_F(WatchedFolderTest, PassesOverWhatIsNoImageWithASentence) {
    WatchedFolder folder = watch();
    put(in("readme.txt"), "exported by a C-arm");
    std::this_thread::sleep_for(50ms);
    put(in("a.dcm"), picture(6));
    const auto acquired = folder.acquire({}, Progress::none());
    EXPECT_EQ(markOf(acquired), 6);
    bool said = false;
    for (const std::string& warning : acquired->provenance.warnings)
        said = said || warning.find("readme.txt") != std::string::npos;
    EXPECT_TRUE(said);
}

TEST_F(WatchedFolderTest, TellsABadImageOnceAndGoesOn) {
    WatchedFolder folder = watch();
    put(in("cut off.dcm"), picture(1).substr(0, 900));
    const auto bad = folder.acquire({}, Progress::none());
    ASSERT_FALSE(bad.ok());
    EXPECT_EQ(bad.error().code, ErrorCode::invalidInput);
    EXPECT_NE(bad.error().message().find("cut off.dcm"), std::string::npos) << bad.error().message();
    put(in("good.dcm"), picture(2));
    EXPECT_EQ(markOf(folder.acquire({}, Progress::none())), 2);
}

TEST_F(WatchedFolderTest, LooksIntoSubfoldersAndTakesWhatIsThereWhenAsked) {
    fs::create_directories(in("20260301/series"));
    put(in("20260301/series/a.dcm"), picture(8));
    WatchedFolderOptions options = quick();
    options.take_present = true;
    WatchedFolder folder = watch(options);
    EXPECT_EQ(markOf(folder.acquire({}, Progress::none())), 8);
}

TEST_F(WatchedFolderTest, SaysThatAFolderIsNotThere) {
    const auto missing = WatchedFolder::open(scratch_ / "nowhere");
    ASSERT_FALSE(missing.ok());
    EXPECT_EQ(missing.error().code, ErrorCode::invalidInput);
    WatchedFolder folder = watch();
    fs::remove_all(scratch_ / "in");
    const auto gone = folder.acquire({}, Progress::none());
    ASSERT_FALSE(gone.ok());
    EXPECT_EQ(gone.error().code, ErrorCode::invalidInput);
    WatchedFolderOptions wrong;
    wrong.patience = 1ms;
    EXPECT_EQ(WatchedFolder::open(scratch_ / "out", wrong).error().code, ErrorCode::invalidOption);
}

}  // namespace
}  // namespace fluorocut

// A folder that a C-arm or a PACS exports its pictures into, as an ImageSource: `acquire` waits for the next one.
//
// A file counts as complete when neither its size nor its time has changed for `settle` and it can be read as an image.
// One that cannot be read may still be on its way (exporters pause): it is tried again whenever it has changed, and
// given up `patience` after its last change. What is given up is an Error of acquire() when it begins as an image does,
// told once; anything else (a text, a DICOMDIR) is passed over, and the next image carries a sentence about it among
// its warnings. Names that exporters use while they write (.part, .tmp, a leading dot, a trailing ~) are not looked at.
//
// Each file is handed over once: the same name counts anew only with another size or time, and one DICOM instance that
// comes under two names comes once. Of several that are complete, the one with the earliest acquisition time comes
// first (DICOM; others by the time of the file); while anything in the folder is still changing, it is waited for, so
// that an export of many is in order whatever its order of writing. Subfolders are looked into, two deep.
//
// Only what comes after the source was made is a new picture, unless options say otherwise.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/imaging/image_source.h"

namespace fluorocut {

struct WatchedFolderOptions {
    std::chrono::milliseconds settle{500};
    std::chrono::milliseconds patience{10000};
    std::chrono::milliseconds look_every{50};
    bool take_present = false;  // also what lies there already

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

class WatchedFolder final : public ImageSource {
  public:
    // invalidInput: no such folder, or not to be read.
    static Result<WatchedFolder> open(const std::filesystem::path& folder, const WatchedFolderOptions& options = {});

    std::string name() const override { return folder_.string(); }
    ImageSourceCapabilities capabilities() const override { return {}; }
    // Waits until there is one or it is cancelled.
    Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) override;

  private:
    using Clock = std::chrono::steady_clock;

    struct Seen {
        std::uintmax_t size = 0;
        std::filesystem::file_time_type time;
        Clock::time_point changed;  // when that was first seen
        bool done = false;          // handed over, passed over or told
        bool tried = false;         // in this state, and could not be read
        std::string order;          // of a complete one
    };

    explicit WatchedFolder(std::filesystem::path folder, const WatchedFolderOptions& options)
        : folder_(std::move(folder)), options_(options) {}

    Result<void> look();
    // A file that is complete, given up with an error, or nothing yet.
    std::optional<Result<AcquiredImage>> next();
    std::optional<Error> giveUp(const std::filesystem::path& file, const Error& why);

    std::filesystem::path folder_;
    WatchedFolderOptions options_;
    std::map<std::filesystem::path, Seen> files_;
    std::set<std::string> instances_;
    std::vector<std::string> passed_over_;
    std::uint64_t acquired_ = 0;
};

}  // namespace fluorocut

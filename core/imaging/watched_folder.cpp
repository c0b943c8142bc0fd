#include "core/imaging/watched_folder.h"

#include <algorithm>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "core/imaging/file_image_source.h"
#include "core/io/file_format.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr int kDepth = 2;                    // of subfolders
constexpr std::size_t kMostFiles = 100'000;  // a folder of more is no export folder

// As exporters name what they have not finished.
bool isPassing(const fs::path& file) {
    const std::string name = file.filename().string(), extension = file.extension().string();
    return name.starts_with('.') || name.ends_with('~') || extension == ".part" || extension == ".tmp" ||
           extension == ".partial" || extension == ".filepart" || extension == ".crdownload";
}

bool isImage(FileFormat format) {
    switch (format) {
        case FileFormat::png:
        case FileFormat::tiff:
        case FileFormat::metaImage:
        case FileFormat::nrrd:
        case FileFormat::dicom:
            return true;
        default:
            return false;
    }
}

// Digits that sort among those of a DICOM acquisition time: local time, as devices have it.
std::string orderOf(fs::file_time_type time) {
    const auto system = std::chrono::time_point_cast<std::chrono::system_clock::duration>(
        time - fs::file_time_type::clock::now() + std::chrono::system_clock::now());
    const std::time_t seconds = std::chrono::system_clock::to_time_t(system);
    std::tm local{};
    localtime_r(&seconds, &local);
    char text[32];
    std::strftime(text, sizeof text, "%Y%m%d%H%M%S", &local);
    const auto rest =
        std::chrono::duration_cast<std::chrono::microseconds>(system.time_since_epoch()).count() % 1000000;
    return fmt::format("{}.{:06}", text, rest < 0 ? 0 : rest);
}

}  // namespace

Result<void> WatchedFolderOptions::validate() const {
    using std::chrono::milliseconds;
    const auto within = [](const char* field, milliseconds value, milliseconds least,
                           milliseconds most) -> Result<void> {
        if (value >= least && value <= most) return {};
        return invalidOption(field, fmt::format("{} ms", value.count()),
                             fmt::format("{} to {} ms", least.count(), most.count()));
    };
    if (auto ok = within("settle", settle, milliseconds(1), milliseconds(60'000)); !ok) return ok;
    if (auto ok = within("patience", patience, settle, milliseconds(3'600'000)); !ok) return ok;
    return within("look_every", look_every, milliseconds(1), milliseconds(100));
}

Result<WatchedFolder> WatchedFolder::open(const fs::path& folder, const WatchedFolderOptions& options) {
    if (auto ok = options.validate(); !ok) return ok.error();
    std::error_code error;
    if (!fs::is_directory(folder, error))
        return invalidInput(folder.string(), "no folder", "a folder that pictures are exported into",
                            "make it, or choose another one");
    WatchedFolder watched(folder, options);
    if (auto ok = watched.look(); !ok) return ok.error();
    for (auto& [path, seen] : watched.files_)
        seen.done = !options.take_present;
    return watched;
}

Result<void> WatchedFolder::look() {
    std::error_code error;
    auto each = fs::recursive_directory_iterator(folder_, fs::directory_options::skip_permission_denied, error);
    if (error)
        return invalidInput(folder_.string(), error.message(), "a folder that can be read",
                            "connect the drive again, or choose another folder");
    const auto now = Clock::now();
    for (; each != fs::recursive_directory_iterator(); each.increment(error)) {
        if (error) break;  // it went away meanwhile; the next look tells
        if (each.depth() >= kDepth) each.disable_recursion_pending();
        std::error_code gone;
        if (!each->is_regular_file(gone) || gone || isPassing(each->path())) continue;
        const auto size = each->file_size(gone);
        const auto time = gone ? fs::file_time_type() : each->last_write_time(gone);
        if (gone) continue;
        const auto found = files_.find(each->path());
        if (found != files_.end() && found->second.size == size && found->second.time == time) continue;
        if (found == files_.end() && files_.size() >= kMostFiles)
            return invalidInput(folder_.string(), fmt::format("more than {} files", kMostFiles), "an export folder",
                                "watch a folder of its own");
        Seen fresh;
        fresh.size = size;
        fresh.time = time;
        fresh.changed = now;
        files_[each->path()] = fresh;
    }
    return {};
}

std::optional<Error> WatchedFolder::giveUp(const fs::path& file, const Error& why) {
    const Result<FileFormat> format = detectFormat(file);
    if (format && isImage(*format)) return why;
    passed_over_.push_back(file.string() + " was passed over: it is no image");
    return {};
}

std::optional<Result<AcquiredImage>> WatchedFolder::next() {
    const auto now = Clock::now();
    std::map<std::string, fs::path> complete;  // by their order
    bool moving = false;
    std::optional<Error> bad;
    for (auto& [path, seen] : files_) {
        if (seen.done) continue;
        const auto still = now - seen.changed;
        if (still < options_.settle) {
            moving = true;
            continue;
        }
        if (seen.order.empty() && !seen.tried) {
            const auto file = readImage(path);
            if (file) {
                const std::string& uid = file->info.instance_uid;
                if (!uid.empty() && instances_.contains(uid)) {
                    seen.done = true;
                    continue;
                }
                seen.order = file->info.acquired.empty() ? orderOf(seen.time) : file->info.acquired;
            } else {
                seen.tried = true;
            }
        }
        if (!seen.order.empty()) {
            complete.emplace(seen.order + " " + path.string(), path);
        } else if (still < options_.patience) {
            moving = true;  // it may be on its way
        } else if (!bad) {
            seen.done = true;
            const auto file = readImage(path);
            if (!file) bad = giveUp(path, file.error());
        }
    }
    if (bad) return Result<AcquiredImage>(*bad);
    if (moving) return {};
    for (const auto& [order, path] : complete) {
        files_[path].done = true;
        auto file = readImage(path);
        if (!file) {
            if (file.error().code == ErrorCode::invalidInput && !fs::exists(path)) continue;  // taken away again
            return Result<AcquiredImage>(file.error());
        }
        const std::string uid = file->info.instance_uid;
        if (!uid.empty() && !instances_.insert(uid).second) continue;
        return Result<AcquiredImage>(acquiredFrom(std::move(*file), path));
    }
    return {};
}

Result<AcquiredImage> WatchedFolder::acquire(const ImageRequest& request, Progress& progress) {
    if (auto ok = checkRequest(*this, request); !ok) return ok.error();
    progress.report(0, "waiting for a picture in " + name());
    while (true) {
        if (progress.isCancelled()) return cancelled(name());
        if (auto ok = look(); !ok) return ok.error();
        if (auto found = next()) {
            if (!*found) return found->error();
            AcquiredImage acquired = std::move(**found);
            acquired.provenance.source = name();
            acquired.provenance.sequence = acquired_++;
            auto& warnings = acquired.provenance.warnings;
            warnings.insert(warnings.begin(), passed_over_.begin(), passed_over_.end());
            passed_over_.clear();
            progress.report(1, "read");
            return acquired;
        }
        std::this_thread::sleep_for(options_.look_every);
    }
}

}  // namespace fluorocut

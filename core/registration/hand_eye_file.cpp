#include "core/registration/hand_eye_file.h"

#include <optional>
#include <set>

#include <fmt/format.h>

#include "core/io/json_file.h"
#include "core/io/pose_file.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostObservations = 1000;

class Reader {
  public:
    explicit Reader(JsonObject& file) : file_(file), folder_(file.path().parent_path()) {}

    Result<HandEyeFile> read() {
        HandEyeFile result;
        const std::optional<std::string> carm = file_.optionalText("carm");
        if (const std::optional<std::string> corkscrew = file_.optionalText("corkscrew"))
            result.corkscrew = named(*corkscrew);
        std::vector<JsonObject> observations = file_.objects("observations");
        if (!file_.failed() && (observations.empty() || observations.size() > kMostObservations)) {
            file_.fail("observations", fmt::format("{} observations", observations.size()),
                       fmt::format("1 to {}", kMostObservations));
        }
        std::set<std::string> names;
        for (std::size_t i = 0; i < observations.size() && !file_.failed(); ++i) {
            Result<HandEyeEntry> entry = observation(observations[i], i, carm);
            if (!entry) return entry.error();
            if (!file_.failed() && !names.insert(entry->observation.name).second)
                observations[i].fail("name", "\"" + entry->observation.name + "\" a second time", "names that differ");
            if (!file_.failed() && !entry->image.empty() && result.corkscrew.empty()) {
                file_.fail("corkscrew", "nothing, with observations that are images",
                           "the file of the corkscrew, fluorocut/corkscrew/1");
            }
            result.entries.push_back(std::move(*entry));
        }
        if (Result<void> good = file_.finish(); !good) return good.error();
        result.inputs = std::move(inputs_);
        return result;
    }

  private:
    fs::path named(const std::string& path) {
        inputs_.push_back(folder_ / path);
        return inputs_.back();
    }

    // Exactly one of several fields.
    static std::string one(JsonObject& object, const std::vector<std::string>& fields) {
        std::string present, all;
        int count = 0;
        for (const std::string& field : fields) {
            all += (all.empty() ? "" : ", ") + field;
            if (object.isNull(field)) continue;
            present = field;
            ++count;
        }
        if (count != 1 && !object.failed()) {
            object.fail(fields[0], count == 0 ? "nothing" : fmt::format("{} ways of saying it", count),
                        "one of " + all);
        }
        return count == 1 ? present : "";
    }

    Result<HandEyeEntry> observation(JsonObject& object, std::size_t index, const std::optional<std::string>& carm) {
        HandEyeEntry entry;
        HandEyeObservation& seen = entry.observation;
        seen.name = object.optionalText("name").value_or("");
        seen.imager = object.optionalText("imager").value_or("imager");
        const std::string robot = one(object, {"robot_from_flange", "robot_from_flange_file"});
        const std::string corkscrew = one(object, {"imager_from_corkscrew", "imager_from_corkscrew_file", "image"});
        if (object.failed()) return entry;
        if (robot == "robot_from_flange") {
            seen.robot_from_flange = object.rigid(robot);
        } else {
            const Result<Pose> pose = readPose(named(object.text(robot)), Frame::robot, Frame::flange);
            if (!pose) return pose.error();
            seen.robot_from_flange = pose->target_from_source;
        }
        const std::optional<std::string> own_carm = object.optionalText("carm");
        if (corkscrew == "imager_from_corkscrew") {
            seen.imager_from_corkscrew = object.rigid(corkscrew);
            seen.covariance = readCovariance(object, "covariance");
        } else if (corkscrew == "image") {
            const std::string image = object.text("image");
            entry.image = named(image);
            if (seen.name.empty()) seen.name = image;
            if (!own_carm && !carm) {
                object.fail("carm", "nothing, with an image", "the C-arm's file, here or for all observations");
                return entry;
            }
            entry.carm = named(own_carm ? *own_carm : *carm);
        } else {
            const Result<Pose> pose = readPose(named(object.text(corkscrew)), Frame::imager, Frame::corkscrew);
            if (!pose) return pose.error();
            seen.imager_from_corkscrew = pose->target_from_source;
            seen.covariance = pose->covariance;
        }
        if (seen.name.empty()) seen.name = fmt::format("observation {}", index + 1);
        return entry;
    }

    JsonObject& file_;
    fs::path folder_;
    std::vector<fs::path> inputs_;
};

}  // namespace

Result<HandEyeFile> readHandEyeFile(const fs::path& path) {
    Result<JsonObject> file = readJson(path, "fluorocut/hand-eye/1");
    if (!file) return file.error();
    return Reader(*file).read();
}

}  // namespace fluorocut

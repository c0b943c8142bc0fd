#include "core/registration/registration_file.h"

#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "core/io/json_file.h"
#include "core/io/pose_file.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostViews = 100;
constexpr std::size_t kMostPoints = 1000;

// "2026-03-01T09:30:00Z"
bool isUtc(const std::string& text) {
    const std::string form = "dddd-dd-ddTdd:dd:ddZ";
    return text.size() == form.size() && std::equal(text.begin(), text.end(), form.begin(), [](char c, char f) {
               return f == 'd' ? c >= '0' && c <= '9' : c == f;
           });
}

struct Calibration {
    double focal_length = 0;
    double principal_point_mm = 0;
    double focal_length_mm = 0;
};

class Reader {
  public:
    explicit Reader(JsonObject& file) : file_(file), folder_(file.path().parent_path()) {}

    Result<RegistrationFile> read() {
        RegistrationFile result;
        Result<Pose> mount = pose(file_, "flange_from_corkscrew", Frame::flange, Frame::corkscrew);
        if (!mount) return mount.error();
        result.problem.flange_from_corkscrew = *mount;
        std::optional<Calibration> calibration;
        if (!file_.isNull("calibration")) {
            JsonObject object = file_.object("calibration");
            calibration.emplace();
            calibration->focal_length = object.number("focal_length", 0, 0.5);
            calibration->principal_point_mm = object.number("principal_point_mm", 0, 500);
            calibration->focal_length_mm = object.number("focal_length_mm", 10, 10000);
        }
        std::vector<JsonObject> views = file_.objects("views");
        if (!file_.failed() && (views.empty() || views.size() > kMostViews))
            file_.fail("views", fmt::format("{} views", views.size()), fmt::format("1 to {}", kMostViews));
        for (std::size_t i = 0; i < views.size() && !file_.failed(); ++i) {
            if (const Result<void> good = view(views[i], calibration, result); !good) return good.error();
        }
        if (!file_.isNull("points")) {
            std::vector<JsonObject> points = file_.objects("points");
            if (points.size() > kMostPoints)
                file_.fail("points", fmt::format("{} points", points.size()), fmt::format("at most {}", kMostPoints));
            for (JsonObject& point : points) {
                if (file_.failed()) break;
                NamedPoint one;
                one.name = point.text("name");
                one.in_femur = point.vector<3>("in_femur_mm");
                result.points.push_back(std::move(one));
            }
        }
        if (const Result<void> good = file_.finish(); !good) return good.error();
        result.inputs = std::move(inputs_);
        return result;
    }

  private:
    Result<Pose> pose(JsonObject& parent, const char* field, Frame target, Frame source) {
        JsonObject object = parent.object(field);
        Pose result{target, source, Rigid3(), std::nullopt};
        if (object.failed()) return result;  // finish() tells
        if (!object.isNull("file")) {
            for (const char* other : {"matrix", "covariance"})
                if (object.has(other)) object.fail(other, "a value beside a file", "one of the two");
            if (object.failed()) return result;
            inputs_.push_back(folder_ / object.text("file"));
            return readPose(inputs_.back(), target, source);
        }
        result.target_from_source = object.rigid("matrix");
        result.covariance = readCovariance(object, "covariance");
        return result;
    }

    Result<void> view(JsonObject& object, const std::optional<Calibration>& calibration, RegistrationFile& result) {
        ChainView view;
        view.name = object.text("name");
        const std::string time = object.optionalText("time").value_or("");
        if (!time.empty() && !isUtc(time)) object.fail("time", "\"" + time + "\"", "UTC as 2026-03-01T09:30:00Z");
        const std::string imager = object.optionalText("imager").value_or("C-arm");
        if (object.failed()) return {};
        Result<Pose> robot = pose(object, "robot_from_flange", Frame::robot, Frame::flange);
        if (!robot) return robot.error();
        Result<Pose> corkscrew = pose(object, "imager_from_corkscrew", Frame::imager, Frame::corkscrew);
        if (!corkscrew) return corkscrew.error();
        Result<Pose> femur = pose(object, "imager_from_femur", Frame::imager, Frame::femur);
        if (!femur) return femur.error();
        if (object.failed()) return {};
        view.robot_from_flange = *robot;
        view.imager_from_corkscrew.pose = *corkscrew;
        view.imager_from_femur.pose = *femur;
        if (calibration) {
            for (PoseMeasurement* measured : {&view.imager_from_corkscrew, &view.imager_from_femur})
                share(*measured, *calibration, parametersOf(imager, *calibration, result.problem));
        }
        result.problem.views.push_back(std::move(view));
        result.times.push_back(time);
        return {};
    }

    std::vector<std::size_t> parametersOf(const std::string& imager, const Calibration& calibration,
                                          ChainProblem& problem) {
        const auto [at, is_new] = imagers_.try_emplace(imager, problem.parameters.size());
        if (is_new) {
            problem.parameters.push_back({"focal length of " + imager, "focal length", calibration.focal_length});
            for (const char* axis : {"u", "v"}) {
                problem.parameters.push_back({fmt::format("image centre {} of {}", axis, imager), "image centre",
                                              calibration.principal_point_mm});
            }
        }
        return {at->second, at->second + 1, at->second + 2};
    }

    static void share(PoseMeasurement& measured, const Calibration& calibration, std::vector<std::size_t> parameters) {
        const double depth = measured.pose.target_from_source.translation().z();
        measured.parameters = std::move(parameters);
        measured.sensitivity = Eigen::MatrixXd::Zero(6, 3);
        measured.sensitivity(2, 0) = depth;
        measured.sensitivity(0, 1) = measured.sensitivity(1, 2) = -depth / calibration.focal_length_mm;
    }

    JsonObject& file_;
    fs::path folder_;
    std::vector<fs::path> inputs_;
    std::map<std::string, std::size_t> imagers_;
};

}  // namespace

Result<RegistrationFile> readRegistration(const fs::path& path) {
    Result<JsonObject> file = readJson(path, "fluorocut/registration/1");
    if (!file) return file.error();
    return Reader(*file).read();
}

}  // namespace fluorocut

#include "core/io/pose_file.h"

#include <string>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {

namespace {

constexpr std::string_view kSchema = "fluorocut/pose/1";

Frame readFrame(JsonObject& file, std::string_view field) {
    const std::string value = file.text(field);
    if (const std::optional<Frame> frame = frameFromName(value)) return *frame;
    if (!file.failed()) {
        file.fail(field, "\"" + value + "\"",
                  "a frame: femur, imager, corkscrew, robot, flange, cutter, cavity, plate or phantom");
    }
    return {};
}

template <class M>
nlohmann::ordered_json rows(const M& matrix) {
    nlohmann::ordered_json result = nlohmann::ordered_json::array();
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
        nlohmann::ordered_json row = nlohmann::ordered_json::array();
        for (Eigen::Index c = 0; c < matrix.cols(); ++c)
            row.push_back(matrix(r, c));
        result.push_back(row);
    }
    return result;
}

}  // namespace

std::optional<Matrix6> readCovariance(JsonObject& file, std::string_view field) {
    if (file.isNull(field)) return std::nullopt;
    const Matrix6 covariance = file.matrix(field, 6, 6);
    if (file.failed()) return std::nullopt;
    // Both limits are relative: files carry as few as 6 digits.
    const double scale = covariance.cwiseAbs().maxCoeff();
    const double asymmetry = (covariance - covariance.transpose()).cwiseAbs().maxCoeff();
    if (!(asymmetry <= 1e-5 * scale)) {
        file.fail(field, fmt::format("a matrix that is not symmetric (by {:.3g})", asymmetry), "a symmetric matrix");
        return std::nullopt;
    }
    const Matrix6 symmetric = 0.5 * (covariance + covariance.transpose());
    const double least = Eigen::SelfAdjointEigenSolver<Matrix6>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()[0];
    if (!(least >= -1e-5 * scale)) {
        file.fail(field, fmt::format("a negative variance ({:.3g}) in some direction", least),
                  "a positive semi-definite matrix");
        return std::nullopt;
    }
    return symmetric;
}

Result<Pose> readPose(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    Pose pose;
    pose.target = readFrame(*file, "target");
    pose.source = readFrame(*file, "source");
    pose.target_from_source = file->rigid("matrix");
    pose.covariance = readCovariance(*file, "covariance");
    if (Result<void> read = file->finish(); !read) return read.error();
    return pose;
}

Result<Pose> readPose(const std::filesystem::path& path, Frame target, Frame source) {
    Result<Pose> pose = readPose(path);
    if (!pose) return pose;
    if (pose->target != target || pose->source != source) {
        const auto label = [](Frame a, Frame b) { return fmt::format("{}_from_{}", name(a), name(b)); };
        return invalidInput(path.string(), "the pose " + label(pose->target, pose->source), label(target, source));
    }
    return pose;
}

Result<void> writePose(const std::filesystem::path& path, const Pose& pose) {
    nlohmann::ordered_json json;
    json["schema"] = kSchema;
    json["target"] = name(pose.target);
    json["source"] = name(pose.source);
    json["matrix"] = rows(pose.target_from_source.matrix());
    if (pose.covariance) json["covariance"] = rows(*pose.covariance);
    return writeWhole(path, json.dump(2) + "\n");
}

}  // namespace fluorocut

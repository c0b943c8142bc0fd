#include "core/registration/hand_eye/mistakes.h"

#include <limits>

#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut::hand_eye {
namespace {

// Images that miss the common answer by this much (rms) say different things, not the same with noise.
constexpr double kContradictionMm = 3, kContradictionRad = 0.035;

// One simple mistake, undone.
struct Mistake {
    const char* sentence;  // "found: ..., but ... fit"
    void (*undo)(std::vector<HandEyeObservation>&);
};

void replacePose(HandEyeObservation& one, const Rigid3& pose) {
    // What was known of the pose's noise belongs to the pose as it was; its size is all that is asked here.
    one.imager_from_corkscrew = pose;
    one.covariance.reset();
    one.evidence.reset();
}

void scaleRobot(std::vector<HandEyeObservation>& all, double factor) {
    for (HandEyeObservation& one : all)
        one.robot_from_flange = Rigid3(one.robot_from_flange.rotation(), factor * one.robot_from_flange.translation());
}

void shiftRobot(std::vector<HandEyeObservation>& all, std::size_t by) {
    std::vector<Rigid3> poses;
    for (const HandEyeObservation& one : all)
        poses.push_back(one.robot_from_flange);
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i].robot_from_flange = poses[(i + by) % all.size()];
}

const Mistake kMistakes[] = {
    {"the robot poses fit when they are inverted: they seem to be flange_from_robot",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all)
             one.robot_from_flange = one.robot_from_flange.inverse();
     }},
    {"the corkscrew poses fit when they are inverted: they seem to be corkscrew_from_imager",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all)
             replacePose(one, poseOf(one).inverse());
     }},
    {"the poses fit when all are inverted: they seem to be flange_from_robot and corkscrew_from_imager",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all) {
             one.robot_from_flange = one.robot_from_flange.inverse();
             replacePose(one, poseOf(one).inverse());
         }
     }},
    {"the robot poses fit when they are multiplied by 1000: they seem to be in metres",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 1000); }},
    {"the robot poses fit when they are divided by 1000: they seem to be in micrometres",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 0.001); }},
    {"the robot poses fit when they are multiplied by 25.4: they seem to be in inches",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 25.4); }},
    {"the robot poses fit in reverse order",
     [](std::vector<HandEyeObservation>& all) {
         std::vector<Rigid3> poses;
         for (const HandEyeObservation& one : all)
             poses.push_back(one.robot_from_flange);
         for (std::size_t i = 0; i < all.size(); ++i)
             all[i].robot_from_flange = poses[all.size() - 1 - i];
     }},
    {"the robot poses fit when each is taken for the image before it",
     [](std::vector<HandEyeObservation>& all) { shiftRobot(all, 1); }},
    {"the robot poses fit when each is taken for the image after it",
     [](std::vector<HandEyeObservation>& all) { shiftRobot(all, all.size() - 1); }}};

}  // namespace

bool contradictory(const Fit& fit) {
    if (!fit.found || 2 * fit.count() <= fit.used.size()) return true;
    return !(fit.placeMm() <= kContradictionMm && fit.rotationRad() <= kContradictionRad);
}

Error explainContradiction(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options,
                           const Fit& fit) {
    const char* const where = "robot-corkscrew calibration";
    const std::string found =
        fit.found && fit.count() > 0
            ? fmt::format("poses that contradict each other: {} of {} agree, within {:.2g} mm and {:.2g} degrees",
                          fit.count(), fit.used.size(), fit.placeMm(), degreesFromRadians(fit.rotationRad()))
            : "poses that contradict each other";
    // The mistake that explains the images best, and most of them.
    const char* explanation = nullptr;
    double best_mm = std::numeric_limits<double>::infinity();
    for (const Mistake& mistake : kMistakes) {
        std::vector<HandEyeObservation> tried = observations;
        mistake.undo(tried);
        HandEyeOptions plain = options;
        plain.relinearise = nullptr;  // the images speak of the poses as they were
        const Fit other = Problem(tried, plain).solve();
        if (contradictory(other) || 5 * other.count() < 4 * other.used.size()) continue;
        if (!(other.placeMm() < best_mm)) continue;
        best_mm = other.placeMm();
        explanation = mistake.sentence;
    }
    if (explanation) {
        return invalidInput(
            where, found,
            fmt::format("robot_from_flange and imager_from_corkscrew of the same moment, in mm; {}", explanation),
            "correct the file");
    }
    return noSolution(where, found, "one place of the corkscrew on the flange that explains the images",
                      "see whether the robot poses are in another order or unit, and whether C-arm or corkscrew moved");
}

}  // namespace fluorocut::hand_eye

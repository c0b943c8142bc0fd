#include "core/robot/robot_registry.h"

#include <string>

#include <fmt/format.h>

#include "core/robot/adaptors/simulated_robot.h"

namespace fluorocut {

const std::vector<RobotEntry>& robotEntries() {
    static const std::vector<RobotEntry> entries{
        {"simulated", []() -> std::unique_ptr<RobotAdaptor> { return std::make_unique<SimulatedRobot>(); }},
    };
    return entries;
}

Result<std::unique_ptr<RobotAdaptor>> makeRobot(std::string_view name) {
    std::string names;
    for (const RobotEntry& entry : robotEntries()) {
        if (entry.name == name) return entry.make();
        names += fmt::format("{}{}", names.empty() ? "" : ", ", entry.name);
    }
    return invalidOption("robot", fmt::format("'{}'", name), "one of " + names);
}

}  // namespace fluorocut

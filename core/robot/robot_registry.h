// Every robot adaptor there is, by name. One line in the .cpp makes a new one known, and the contract test run over it.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "core/robot/robot_adaptor.h"

namespace fluorocut {

struct RobotEntry {
    std::string_view name;
    std::unique_ptr<RobotAdaptor> (*make)();  // with its own defaults, disconnected
};

// The first is the default.
const std::vector<RobotEntry>& robotEntries();

// invalidOption lists the names there are.
Result<std::unique_ptr<RobotAdaptor>> makeRobot(std::string_view name);

}  // namespace fluorocut

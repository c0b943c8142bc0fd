// The log: one spdlog logger to stderr for everyone. stdout belongs to results.
#pragma once

#include <spdlog/spdlog.h>

namespace fluorocut {

// Warnings and worse are shown unless the program raises the level.
spdlog::logger& logger();

}  // namespace fluorocut

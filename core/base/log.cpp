#include "core/base/log.h"

#include <memory>

#include <spdlog/sinks/stdout_sinks.h>

namespace fluorocut {

spdlog::logger& logger() {
    static const std::shared_ptr<spdlog::logger> instance = [] {
        auto log = std::make_shared<spdlog::logger>("fluorocut", std::make_shared<spdlog::sinks::stderr_sink_mt>());
        log->set_pattern("%l: %v");
        log->set_level(spdlog::level::warn);
        return log;
    }();
    return *instance;
}

}  // namespace fluorocut

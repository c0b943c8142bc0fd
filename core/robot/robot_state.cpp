#include "core/robot/robot_state.h"

#include <string>

#include <fmt/format.h>

namespace fluorocut {
namespace {

struct Transition {
    RobotState from;
    RobotEvent event;
    RobotState to;
};

using enum RobotState;
using Event = RobotEvent;

constexpr Transition kTransitions[] = {
    {disconnected, Event::connect, disabled},

    {disabled, Event::disconnect, disconnected},
    {disabled, Event::enable, enabled},
    {disabled, Event::disable, disabled},
    {disabled, Event::stop, disabled},
    {disabled, Event::fail, fault},

    {enabled, Event::disconnect, disconnected},
    {enabled, Event::disable, disabled},
    {enabled, Event::execute, executing},
    {enabled, Event::stop, enabled},
    {enabled, Event::fail, fault},

    {executing, Event::disable, disabled},
    {executing, Event::finish, enabled},
    {executing, Event::hold, paused},
    {executing, Event::stop, enabled},
    {executing, Event::fail, fault},

    {paused, Event::disable, disabled},
    {paused, Event::hold, paused},
    {paused, Event::resume, executing},
    {paused, Event::stop, enabled},
    {paused, Event::fail, fault},

    {fault, Event::disable, fault},
    {fault, Event::hold, fault},
    {fault, Event::stop, fault},
    {fault, Event::fail, fault},
    {fault, Event::acknowledge, disabled},
};

std::string_view advice(RobotState state, RobotEvent event) {
    if (event == Event::connect) return "It is connected already.";
    if (event == Event::enable && state != disconnected && state != fault) return "It is enabled already.";
    switch (state) {
        case disconnected:
            return "Connect it first.";
        case disabled:
            return "Enable it first.";
        case enabled:
            return "Nothing is being executed.";
        case executing:
            return "Hold or stop it first.";
        case paused:
            return "Resume or stop it first.";
        case fault:
            return "Acknowledge the fault first.";
    }
    throw std::logic_error("robot state");
}

}  // namespace

std::string_view name(RobotState state) {
    switch (state) {
        case disconnected:
            return "disconnected";
        case disabled:
            return "disabled";
        case enabled:
            return "enabled";
        case executing:
            return "executing";
        case paused:
            return "paused";
        case fault:
            return "fault";
    }
    throw std::logic_error("robot state");
}

std::string_view name(RobotEvent event) {
    switch (event) {
        case Event::connect:
            return "connect";
        case Event::disconnect:
            return "disconnect";
        case Event::enable:
            return "enable";
        case Event::disable:
            return "disable";
        case Event::execute:
            return "execute";
        case Event::finish:
            return "finish";
        case Event::hold:
            return "hold";
        case Event::resume:
            return "resume";
        case Event::stop:
            return "stop";
        case Event::fail:
            return "fail";
        case Event::acknowledge:
            return "acknowledge";
    }
    throw std::logic_error("robot event");
}

std::optional<RobotState> nextState(RobotState state, RobotEvent event) {
    for (const Transition& transition : kTransitions)
        if (transition.from == state && transition.event == event) return transition.to;
    return std::nullopt;
}

Result<void> RobotStateMachine::allows(RobotEvent event) const {
    if (nextState(state_, event)) return {};
    std::string from;
    for (const RobotState state : kRobotStates)
        if (nextState(state, event)) from += fmt::format("{}{}", from.empty() ? "" : " or ", name(state));
    return noSolution(fmt::format("robot, {}", name(event)), fmt::format("the state {}", name(state_)), from,
                      std::string(advice(state_, event)));
}

Result<void> RobotStateMachine::apply(RobotEvent event) {
    if (auto allowed = allows(event); !allowed) return allowed;
    state_ = *nextState(state_, event);
    return {};
}

}  // namespace fluorocut

// The states a robot may be in and what may lead from one to another: one table, and a machine that walks it.
//
//                 connect   disconnect    enable   disable   execute    finish   hold    resume     stop     fail
//                 acknowledge
//  disconnected   disabled  -             -        -         -          -        -       -          -        -      -
//  disabled       -         disconnected  enabled  disabled  -          -        -       -          disabled fault  -
//  enabled        -         disconnected  -        disabled  executing  -        -       -          enabled  fault  -
//  executing      -         -             -        disabled  -          enabled  paused  -          enabled  fault  -
//  paused         -         -             -        disabled  -          -        paused  executing  enabled  fault  -
//  fault          -         -             -        fault     -          -        fault   -          fault    fault
//  disabled
//
// Two rules are behind it. What takes motion away (hold, stop, disable, fail) is never refused where there is motion,
// and does no harm where there is none. What gives motion has one way only: connect, enable, execute; from a fault one
// has to go all of it again, and no way out of `paused` or `fault` is taken but by somebody's command.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "core/base/result.h"

namespace fluorocut {

enum class RobotState { disconnected, disabled, enabled, executing, paused, fault };
enum class RobotEvent { connect, disconnect, enable, disable, execute, finish, hold, resume, stop, fail, acknowledge };

inline constexpr std::array kRobotStates{RobotState::disconnected, RobotState::disabled, RobotState::enabled,
                                         RobotState::executing,    RobotState::paused,   RobotState::fault};
inline constexpr std::array kRobotEvents{RobotEvent::connect, RobotEvent::disconnect, RobotEvent::enable,
                                         RobotEvent::disable, RobotEvent::execute,    RobotEvent::finish,
                                         RobotEvent::hold,    RobotEvent::resume,     RobotEvent::stop,
                                         RobotEvent::fail,    RobotEvent::acknowledge};

std::string_view name(RobotState state);
std::string_view name(RobotEvent event);

// Empty: refused.
std::optional<RobotState> nextState(RobotState state, RobotEvent event);

class RobotStateMachine {
  public:
    RobotState state() const { return state_; }

    // May it happen? The refusal names the state, those from which it may, and what to do first (noSolution).
    Result<void> allows(RobotEvent event) const;
    // Makes it happen; refused, nothing changes.
    Result<void> apply(RobotEvent event);

  private:
    RobotState state_ = RobotState::disconnected;
};

}  // namespace fluorocut

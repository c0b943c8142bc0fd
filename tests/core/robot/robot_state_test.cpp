#include "core/robot/robot_state.h"

#include <map>
#include <string>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

// The header's table, written out a second time: rows are states, columns events; '.' is refused, otherwise the first
// letter of the next state (o: disconnected, d: disabled, e: enabled, x: executing, p: paused, f: fault).
constexpr const char* kTable[] = {
    // connect disconnect enable disable execute finish hold resume stop fail acknowledge
    "d..........",  // disconnected
    ".oed....df.",  // disabled
    ".o.dx...ef.",  // enabled
    "...d.ep.ef.",  // executing
    "...d..pxef.",  // paused
    "...f..f.ffd",  // fault
};

std::optional<RobotState> expected(std::size_t state, std::size_t event) {
    const std::string letters = "odexpf";
    const std::size_t at = letters.find(kTable[state][event]);
    if (at == std::string::npos) return std::nullopt;
    return kRobotStates[at];
}

// A machine brought to a state by the shortest way of commands.
RobotStateMachine machineIn(RobotState state) {
    RobotStateMachine machine;
    const std::map<RobotState, std::vector<RobotEvent>> ways{
        {RobotState::disconnected, {}},
        {RobotState::disabled, {RobotEvent::connect}},
        {RobotState::enabled, {RobotEvent::connect, RobotEvent::enable}},
        {RobotState::executing, {RobotEvent::connect, RobotEvent::enable, RobotEvent::execute}},
        {RobotState::paused, {RobotEvent::connect, RobotEvent::enable, RobotEvent::execute, RobotEvent::hold}},
        {RobotState::fault, {RobotEvent::connect, RobotEvent::fail}}};
    for (const RobotEvent event : ways.at(state))
        EXPECT_TRUE(machine.apply(event));
    EXPECT_EQ(machine.state(), state);
    return machine;
}

TEST(RobotState, EveryStateAndEventGoAsTheTableSays) {
    for (std::size_t s = 0; s < kRobotStates.size(); ++s) {
        for (std::size_t e = 0; e < kRobotEvents.size(); ++e) {
            SCOPED_TRACE(std::string(name(kRobotStates[s])) + ", " + std::string(name(kRobotEvents[e])));
            RobotStateMachine machine = machineIn(kRobotStates[s]);
            const Result<void> done = machine.apply(kRobotEvents[e]);
            const auto next = expected(s, e);
            EXPECT_EQ(done.ok(), next.has_value());
            EXPECT_EQ(machine.state(), next.value_or(kRobotStates[s]));
            if (done) continue;
            // One sentence and an advice: state, event and a state from which it may happen are named.
            const std::string text = done.error().message();
            EXPECT_NE(text.find(name(kRobotStates[s])), std::string::npos) << text;
            EXPECT_NE(text.find(name(kRobotEvents[e])), std::string::npos) << text;
            EXPECT_FALSE(done.error().expected.empty());
            EXPECT_FALSE(done.error().advice.empty());
        }
    }
}

TEST(RobotState, OnlyExecuteAndResumeLeadToMotion) {
    for (const RobotState from : kRobotStates) {
        for (const RobotEvent event : kRobotEvents) {
            if (nextState(from, event) != RobotState::executing) continue;
            EXPECT_TRUE((from == RobotState::enabled && event == RobotEvent::execute) ||
                        (from == RobotState::paused && event == RobotEvent::resume));
        }
    }
}

TEST(RobotState, WhatTakesMotionAwayIsNeverRefusedWhereThereIsMotion) {
    for (const RobotEvent event : {RobotEvent::hold, RobotEvent::stop, RobotEvent::disable, RobotEvent::fail})
        for (const RobotState from : {RobotState::executing, RobotState::paused})
            EXPECT_TRUE(nextState(from, event)) << name(event) << " from " << name(from);
}

TEST(RobotState, AFaultIsLeftByAcknowledgingAndThenAllTheWayAgain) {
    for (const RobotEvent event : kRobotEvents) {
        const auto next = nextState(RobotState::fault, event);
        if (next && *next != RobotState::fault) {
            EXPECT_EQ(event, RobotEvent::acknowledge);
            EXPECT_EQ(*next, RobotState::disabled);
        }
    }
}

}  // namespace
}  // namespace fluorocut

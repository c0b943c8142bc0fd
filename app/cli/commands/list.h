// All subcommands, in the order in which the help shows them.
#pragma once

#include <array>

#include "app/cli/command.h"

namespace fluorocut::cli {

Command declareDemo(CLI::App& parent);
Command declareProcedure(CLI::App& parent);
Command declareDrr(CLI::App& parent);
Command declarePhantom(CLI::App& parent);
Command declareCutVolume(CLI::App& parent);
Command declareDewarp(CLI::App& parent);
Command declareCalibrate(CLI::App& parent);
Command declareCalibrateRobot(CLI::App& parent);  // below calibrate
Command declareCorkscrew(CLI::App& parent);
Command declareCoregister(CLI::App& parent);
Command declareRegister(CLI::App& parent);
Command declareImplant(CLI::App& parent);
Command declarePlan(CLI::App& parent);
Command declareLocateCavity(CLI::App& parent);
Command declareFabricate(CLI::App& parent);
Command declarePaperTables(CLI::App& parent);
Command declareCase(CLI::App& parent);
Command declareInfo(CLI::App& parent);

inline constexpr std::array<Declare, 17> kCommands{
    declareDemo,         declareProcedure, declareDrr,         declarePhantom,  declareCutVolume, declareDewarp,
    declareCalibrate,    declareCorkscrew, declareCoregister,  declareRegister, declareImplant,   declarePlan,
    declareLocateCavity, declareFabricate, declarePaperTables, declareCase,     declareInfo};

}  // namespace fluorocut::cli

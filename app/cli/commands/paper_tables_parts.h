// Parts of paper-tables that have a file of their own.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/error_figures.h"

namespace fluorocut::cli {

nlohmann::ordered_json jsonOf(const ErrorFigures& figures);

struct CorkscrewTablesRequest {
    int scenes = 40;  // of the accuracy in random scenes
    int carms = 4;    // of Tables 1 and 2
    std::uint64_t seed = 1;
    double pixel_mm = 0.32;
    std::string corkscrew = "corkscrew";
};

// Tables 1 and 2 of the paper and the accuracy in random scenes: into `json`, and as text.
Result<std::string> addCorkscrewTables(const CorkscrewTablesRequest& request, nlohmann::ordered_json& json,
                                       Progress& progress);

struct CavityTableRequest {
    int random_trials = 0;
    std::uint64_t seed = 1;
    double pixel_mm = 0.32;
    bool imperfect_ct = false;
};

// Table 3 of the paper and random motions: likewise.
Result<std::string> addCavityTable(const CavityTableRequest& request, nlohmann::ordered_json& json, Progress& progress);

struct Table4Request {
    int trials = 3;  // random ones, beside the paper's three
    std::uint64_t seed = 1;
};

// Table 4: likewise.
Result<std::string> addTable4(const Table4Request& request, nlohmann::ordered_json& json, Progress& progress);

}  // namespace fluorocut::cli

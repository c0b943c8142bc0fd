// Calls the real fluorocut-cli, and holds what it prints against the contract.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/program.h"

namespace fluorocut::test {

inline Finished cli(const std::vector<std::string>& arguments) {
    return runProgram(FLUOROCUT_CLI, arguments);
}

// stdout as the one JSON object that it must be; null, and a failure, when it is anything else.
inline nlohmann::json onlyJson(const Finished& finished) {
    nlohmann::json json = nlohmann::json::parse(finished.out, nullptr, false);
    EXPECT_TRUE(json.is_object()) << "stdout is not exactly one JSON object: " << finished.out;
    return json.is_object() ? json : nlohmann::json();
}

// The `message` of an error told as JSON, after checking that the rest is there.
inline std::string errorMessage(const Finished& finished, const std::string& code) {
    const nlohmann::json json = onlyJson(finished);
    if (!json.contains("error")) {
        ADD_FAILURE() << "no error in " << finished.out;
        return {};
    }
    const nlohmann::json& error = json["error"];
    for (const char* field : {"code", "where", "found", "expected", "advice", "message"}) {
        EXPECT_TRUE(error.contains(field) && error[field].is_string()) << field;
    }
    EXPECT_EQ(error["code"], code);
    // People get the same sentence.
    EXPECT_NE(finished.err.find(error["message"].get<std::string>()), std::string::npos) << finished.err;
    return error["message"];
}

}  // namespace fluorocut::test

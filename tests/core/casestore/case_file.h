// What the tests of the saved case share: a case with a bit of everything, and SQLite without any of our care.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <sqlite3.h>

#include "core/casestore/case_store.h"

namespace fluorocut::test {

// Another program with a grudge: it may do all that SQLite lets it.
class RawFile {
  public:
    explicit RawFile(const std::filesystem::path& path) {
        if (sqlite3_open(path.c_str(), &raw_) != SQLITE_OK) throw std::runtime_error("cannot open " + path.string());
    }
    ~RawFile() { sqlite3_close(raw_); }
    RawFile(const RawFile&) = delete;
    RawFile& operator=(const RawFile&) = delete;

    // Empty when it went well, otherwise SQLite's message.
    std::string run(const std::string& sql) {
        char* message = nullptr;
        sqlite3_exec(raw_, sql.c_str(), nullptr, nullptr, &message);
        std::string text = message != nullptr ? message : "";
        sqlite3_free(message);
        return text;
    }
    // The first column of all rows, one a line.
    std::string ask(const std::string& sql) {
        std::string lines;
        const auto take = [](void* to, int, char** values, char**) {
            *static_cast<std::string*>(to) += std::string(values[0] != nullptr ? values[0] : "") + "\n";
            return 0;
        };
        sqlite3_exec(raw_, sql.c_str(), take, &lines, nullptr);
        return lines;
    }
    std::int64_t number(const std::string& sql) { return std::stoll(ask(sql)); }

  private:
    sqlite3* raw_ = nullptr;
};

inline Step stepOf(const std::string& step_name, const std::string& input, const std::string& result) {
    Step step;
    step.name = step_name;
    step.inputs = {{"before_ap", input}};
    step.options_json = R"({"limit_mm": 0.20, "cycles": 5})";
    step.result = result;
    step.started_utc = utcNow();
    step.finished_utc = utcNow();
    return step;
}

// Rounds of an image, a pose found in it, and a person's word: 1 + 4 * rounds records.
inline Result<void> fill(CaseStore& store, int rounds) {
    for (int round = 0; round < rounds; ++round) {
        const std::string number = std::to_string(round);
        const auto image =
            store.addItem({.kind = ItemKind::image, .schema = "image/png", .file_name = "before_" + number + ".png"},
                          "pixels of " + number + std::string(5000, 'x'));
        if (!image) return image.error();
        const auto pose = store.addItem(
            {.kind = ItemKind::pose, .schema = "fluorocut/pose/1", .file_name = "pose_" + number + ".json"},
            R"({"schema": "fluorocut/pose/1", "round": )" + number + "}");
        if (!pose) return pose.error();
        const auto step = store.addStep(stepOf("register", image->hash, pose->hash));
        if (!step) return step.error();
        const auto decision = store.addDecision({.step = step->record,
                                                 .accepted = round % 2 == 0,
                                                 .who = "Dr. Röntgen",
                                                 .why = "within the limits, \"as seen\""});
        if (!decision) return decision.error();
    }
    return {};
}

}  // namespace fluorocut::test

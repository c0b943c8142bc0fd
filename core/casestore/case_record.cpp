#include "core/casestore/case_record.h"

#include <chrono>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/casestore/sha256.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

using nlohmann::json;

constexpr std::array<std::string_view, 7> kItemKinds{"image", "volume", "mesh",  "calibration",
                                                     "pose",  "plan",   "result"};

Result<std::string> textOf(const json& body) {
    try {
        return body.dump();
    } catch (const json::exception&) {
        return invalidInput("text for the case", "bytes that are not UTF-8", "UTF-8");
    }
}

Result<void> requireText(const char* field, const std::string& text, std::size_t most) {
    if (!text.empty() && text.size() <= most) return {};
    return invalidInput(field, text.empty() ? "nothing" : fmt::format("{} bytes", text.size()),
                        fmt::format("a text of 1 to {} bytes", most));
}

Result<void> requireHash(const std::string& field, const std::string& hash) {
    if (isSha256(hash)) return {};
    return invalidInput(field, fmt::format("'{}'", hash.substr(0, 80)), "a SHA-256 of 64 hexadecimal digits");
}

Result<void> requireTime(const char* field, const std::string& text) {
    constexpr std::string_view kForm = "dddd-dd-ddTdd:dd:dd.dddZ";
    bool good = text.size() == kForm.size();
    for (std::size_t i = 0; good && i < kForm.size(); ++i)
        good = kForm[i] == 'd' ? text[i] >= '0' && text[i] <= '9' : text[i] == kForm[i];
    if (good) return {};
    return invalidInput(field, fmt::format("'{}'", text.substr(0, 40)), "UTC such as 2026-03-01T09:30:00.125Z");
}

// It becomes the name of a file, in a folder that the person chose: no way out of there.
Result<void> requireFileName(const std::string& text) {
    if (const Result<void> good = requireText("item, file_name", text, 120); !good) return good.error();
    bool plain = text.front() != '.';
    for (const char c : text)
        plain = plain && c != '/' && c != '\\' && static_cast<unsigned char>(c) >= 32 && c != 127;
    if (plain) return {};
    return invalidInput("item, file_name", fmt::format("'{}'", text), "a plain file name, such as before_ap.png");
}

Result<void> check(const Item& item) {
    if (const auto good = requireFileName(item.file_name); !good) return good.error();
    if (const auto good = requireText("item, schema", item.schema, 120); !good) return good.error();
    return requireHash("item, hash", item.hash);
}

Result<void> check(const Step& step) {
    if (const auto good = requireText("step, name", step.name, 120); !good) return good.error();
    for (const StepInput& input : step.inputs) {
        if (const auto good = requireText("step, input's role", input.role, 120); !good) return good.error();
        if (const auto good = requireHash("step, input " + input.role, input.hash); !good) return good.error();
    }
    if (!json::parse(step.options_json, nullptr, false).is_object()) {
        return invalidInput("step, options_json", fmt::format("'{}'", step.options_json.substr(0, 80)),
                            "a JSON object");
    }
    if (const auto good = requireHash("step, result", step.result); !good) return good.error();
    if (const auto good = requireTime("step, started_utc", step.started_utc); !good) return good.error();
    return requireTime("step, finished_utc", step.finished_utc);
}

Result<void> check(const Decision& decision) {
    if (const auto good = requireText("decision, who", decision.who, 200); !good) return good.error();
    return requireText("decision, why", decision.why, 4000);
}

Result<JsonObject> open(const CaseRecord& record) {
    return parseJson(record.body, fmt::format("record {}", record.number), "");
}

// What every reader does at its end.
template <class Value>
Result<Value> finished(const JsonObject& object, Value value, const CaseRecord& record) {
    if (const Result<void> read = object.finish(); !read) return read.error();
    if constexpr (requires { check(value); }) {
        if (const Result<void> good = check(value); !good) return good.error();
        value.record = record.number;
        value.recorded_utc = record.recorded_utc;
    }
    return value;
}

}  // namespace

std::string utcNow() {
    using namespace std::chrono;
    const auto now = floor<milliseconds>(system_clock::now());
    const auto day = floor<days>(now);
    const year_month_day date(day);
    const hh_mm_ss time(now - day);
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z", static_cast<int>(date.year()),
                       static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), time.hours().count(),
                       time.minutes().count(), time.seconds().count(), time.subseconds().count());
}

std::string_view name(ItemKind kind) {
    return kItemKinds.at(static_cast<std::size_t>(kind));
}

std::string hashOf(const CaseRecord& record) {
    Sha256 hash;
    for (const std::string& field :
         {std::to_string(record.number), record.recorded_utc, record.kind, record.body, record.previous})
        hash.add(fmt::format("{}:{},", field.size(), field));
    return hash.finish();
}

Result<CaseRecord> appendRecord(Database& database, std::string_view kind, std::string body) {
    CaseRecord record{1, utcNow(), std::string(kind), std::move(body), "", ""};
    Result<Statement> newest = database.prepare("SELECT number, hash FROM record ORDER BY number DESC LIMIT 1");
    if (!newest) return newest.error();
    const Result<bool> row = newest->step();
    if (!row) return row.error();
    if (*row) {
        record.number = newest->integer(0) + 1;
        record.previous = newest->text(1);
    }
    record.hash = hashOf(record);
    Result<Statement> insert = database.prepare("INSERT INTO record VALUES (?1, ?2, ?3, ?4, ?5, ?6)");
    if (!insert) return insert.error();
    insert->bind(1, record.number)
        .bindText(2, record.recorded_utc)
        .bindText(3, record.kind)
        .bindText(4, record.body)
        .bindText(5, record.previous)
        .bindText(6, record.hash);
    if (const Result<bool> done = insert->step(); !done) return done.error();
    return record;
}

Result<bool> hasContent(const Database& database, std::string_view hash) {
    Result<Statement> found = database.prepare("SELECT 1 FROM blob WHERE hash = ?1");
    if (!found) return found.error();
    return found->bindText(1, hash).step();
}

Result<std::string> bodyOf(const Creation& creation) {
    if (const auto good = requireText("case, label", creation.label, 200); !good) return good.error();
    return textOf({{"label", creation.label}, {"id", creation.id}, {"software", creation.software}});
}

Result<std::string> bodyOf(const Item& item) {
    if (const auto good = check(item); !good) return good.error();
    return textOf({{"kind", name(item.kind)},
                   {"schema", item.schema},
                   {"file_name", item.file_name},
                   {"hash", item.hash},
                   {"bytes", item.bytes}});
}

Result<std::string> bodyOf(const Step& step) {
    if (const auto good = check(step); !good) return good.error();
    json inputs = json::array();
    for (const StepInput& input : step.inputs)
        inputs.push_back({{"role", input.role}, {"hash", input.hash}});
    return textOf({{"name", step.name},
                   {"inputs", inputs},
                   {"options_json", step.options_json},
                   {"result", step.result},
                   {"started_utc", step.started_utc},
                   {"finished_utc", step.finished_utc},
                   {"software", step.software}});
}

Result<std::string> bodyOf(const Decision& decision) {
    if (const auto good = check(decision); !good) return good.error();
    return textOf({{"step", decision.step},
                   {"verdict", decision.accepted ? "accepted" : "refused"},
                   {"who", decision.who},
                   {"why", decision.why}});
}

std::string bodyOfMigration(int from, int to) {
    return json({{"from_schema", from}, {"to_schema", to}, {"software", "FluoroCut " FLUOROCUT_VERSION}}).dump();
}

Result<Creation> creationOf(const CaseRecord& record) {
    Result<JsonObject> body = open(record);
    if (!body) return body.error();
    Creation creation{body->text("label"), body->text("id"), body->text("software")};
    return finished(*body, std::move(creation), record);
}

Result<Item> itemOf(const CaseRecord& record) {
    Result<JsonObject> body = open(record);
    if (!body) return body.error();
    Item item;
    item.kind = static_cast<ItemKind>(body->choice("kind", {kItemKinds.begin(), kItemKinds.end()}));
    item.schema = body->text("schema");
    item.file_name = body->text("file_name");
    item.hash = body->text("hash");
    item.bytes = static_cast<std::int64_t>(body->integer("bytes", 0));
    return finished(*body, std::move(item), record);
}

Result<Step> stepOf(const CaseRecord& record) {
    Result<JsonObject> body = open(record);
    if (!body) return body.error();
    Step step;
    step.name = body->text("name");
    for (JsonObject& input : body->objects("inputs"))
        step.inputs.push_back({input.text("role"), input.text("hash")});
    step.options_json = body->text("options_json");
    step.result = body->text("result");
    step.started_utc = body->text("started_utc");
    step.finished_utc = body->text("finished_utc");
    step.software = body->text("software");
    return finished(*body, std::move(step), record);
}

Result<Decision> decisionOf(const CaseRecord& record) {
    Result<JsonObject> body = open(record);
    if (!body) return body.error();
    Decision decision;
    decision.step = body->integer("step", 1);
    decision.accepted = body->choice("verdict", {"refused", "accepted"}) == 1;
    decision.who = body->text("who");
    decision.why = body->text("why");
    return finished(*body, std::move(decision), record);
}

}  // namespace fluorocut

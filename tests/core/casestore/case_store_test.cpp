// A case holds what was put into it, and refuses what would harm it or another file.
#include "core/casestore/case_store.h"

#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/casestore/sha256.h"
#include "tests/core/casestore/case_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::RawFile;
using testing::HasSubstr;
using Access = CaseStore::Access;

class CaseStoreTest : public testing::Test {
  protected:
    std::string textOf(const std::string& name) const {
        std::ifstream file(scratch_ / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    void write(const std::string& name, const std::string& text) const {
        std::ofstream(scratch_ / name, std::ios::binary) << text;
    }
    test::ScratchFolder scratch_;
    std::filesystem::path path_ = scratch_ / "hip.fluorocut";
};

TEST_F(CaseStoreTest, WhatWasPutInComesOut) {
    const std::string pixels("\0\xff\x80 not text", 12);
    Item image;
    Step step;
    Decision decision;
    {
        Result<CaseStore> store = CaseStore::create(path_, "hip 7");
        ASSERT_OK(store);
        const Result<Item> added =
            store->addItem({.kind = ItemKind::image, .schema = "image/png", .file_name = "ap.png"}, pixels);
        ASSERT_OK(added);
        image = *added;
        const Result<Item> empty = store->addItem({.schema = "fluorocut/nothing/1", .file_name = "empty"}, "");
        ASSERT_OK(empty);
        const Result<Step> stepped = store->addStep(test::stepOf("locate-cavity", image.hash, empty->hash));
        ASSERT_OK(stepped);
        step = *stepped;
        const Result<Decision> decided =
            store->addDecision({.step = step.record, .accepted = true, .who = "Ä. Chirurg", .why = "fits\n\"well\""});
        ASSERT_OK(decided);
        decision = *decided;
    }
    EXPECT_FALSE(std::filesystem::exists(path_.string() + "-wal"));  // one file once it is closed
    EXPECT_FALSE(std::filesystem::exists(path_.string() + ".lock"));

    Result<CaseStore> store = CaseStore::open(path_, Access::read);
    ASSERT_OK(store);
    const Result<CaseContent> content = store->content();
    ASSERT_OK(content);
    ASSERT_EQ(content->items.size(), 2U);
    EXPECT_EQ(content->items[0].kind, ItemKind::image);
    EXPECT_EQ(content->items[0].schema, "image/png");
    EXPECT_EQ(content->items[0].file_name, "ap.png");
    EXPECT_EQ(content->items[0].hash, sha256(pixels));
    EXPECT_EQ(content->items[0].bytes, 12);
    EXPECT_EQ(content->items[0].record, 2);
    EXPECT_EQ(content->items[0].recorded_utc, image.recorded_utc);
    EXPECT_EQ(store->bytes(image.hash).value(), pixels);
    EXPECT_EQ(store->bytes(content->items[1].hash).value(), "");
    ASSERT_EQ(content->steps.size(), 1U);
    EXPECT_EQ(content->steps[0].name, "locate-cavity");
    ASSERT_EQ(content->steps[0].inputs.size(), 1U);
    EXPECT_EQ(content->steps[0].inputs[0].role, "before_ap");
    EXPECT_EQ(content->steps[0].inputs[0].hash, image.hash);
    EXPECT_EQ(content->steps[0].options_json, R"({"limit_mm": 0.20, "cycles": 5})");  // to the letter
    EXPECT_EQ(content->steps[0].result, content->items[1].hash);
    EXPECT_EQ(content->steps[0].started_utc, step.started_utc);
    EXPECT_EQ(content->steps[0].finished_utc, step.finished_utc);
    EXPECT_THAT(content->steps[0].software, testing::MatchesRegex("FluoroCut [0-9.]+"));
    ASSERT_EQ(content->decisions.size(), 1U);
    EXPECT_EQ(content->decisions[0].step, step.record);
    EXPECT_TRUE(content->decisions[0].accepted);
    EXPECT_EQ(content->decisions[0].who, "Ä. Chirurg");
    EXPECT_EQ(content->decisions[0].why, "fits\n\"well\"");
    EXPECT_EQ(content->decisions[0].recorded_utc, decision.recorded_utc);

    const Result<CaseInfo> info = store->info();
    ASSERT_OK(info);
    EXPECT_EQ(info->label, "hip 7");
    EXPECT_EQ(info->id.size(), 32U);
    EXPECT_EQ(info->schema_version, 2);
    EXPECT_EQ(info->records, 5);
    EXPECT_EQ(info->contents, 2);
    EXPECT_EQ(info->content_bytes, 12);
    EXPECT_LE(info->created_utc, info->newest_utc);
    const Result<CaseCheck> check = store->verify({}, Progress::none());
    ASSERT_OK(check);
    EXPECT_TRUE(check->whole());
    EXPECT_EQ(check->records, 5);
    EXPECT_EQ(check->contents, 2);
    EXPECT_EQ(check->newest_hash, info->newest_hash);
}

TEST_F(CaseStoreTest, SameContentLiesThereOnce) {
    Result<CaseStore> store = CaseStore::create(path_, "twice");
    ASSERT_OK(store);
    const Item item{.kind = ItemKind::plan, .schema = "fluorocut/plan/1", .file_name = "plan.json"};
    ASSERT_OK(store->addItem(item, "{}"));
    ASSERT_OK(store->addItem(item, "{}"));
    EXPECT_EQ(store->content()->items.size(), 2U);
    EXPECT_EQ(store->info()->contents, 1);
    EXPECT_TRUE(store->verify({}, Progress::none())->whole());
}

TEST_F(CaseStoreTest, LastAcceptedStepIsTheOneToBuildOn) {
    Result<CaseStore> store = CaseStore::create(path_, "accepted");
    ASSERT_OK(store);
    const Result<Item> item = store->addItem({.schema = "a/1", .file_name = "a.json"}, "{}");
    ASSERT_OK(item);
    const auto step = [&](const std::string& name) {
        return store->addStep(test::stepOf(name, item->hash, item->hash))->record;
    };
    const auto decide = [&](std::int64_t record, bool accepted) {
        EXPECT_OK(store->addDecision({.step = record, .accepted = accepted, .who = "A", .why = "so"}));
    };
    const auto accepted = [&] {
        const std::optional<Step> last = lastAccepted(*store->content(), "register");
        return last ? last->record : 0;
    };
    const std::int64_t first = step("register");
    EXPECT_EQ(accepted(), 0);  // nobody said anything
    decide(first, true);
    EXPECT_EQ(accepted(), first);
    const std::int64_t second = step("register");
    decide(step("other"), true);
    EXPECT_EQ(accepted(), first);
    decide(second, true);
    EXPECT_EQ(accepted(), second);
    decide(second, false);  // thought better of it
    EXPECT_EQ(accepted(), first);
}

TEST_F(CaseStoreTest, RefusesWhatIsNotThereOrNotWellFormed) {
    Result<CaseStore> store = CaseStore::create(path_, "refusals");
    ASSERT_OK(store);
    const Result<Item> item = store->addItem({.schema = "a/1", .file_name = "a.json"}, "{}");
    ASSERT_OK(item);
    const std::string absent = sha256("absent");
    EXPECT_THAT(store->addStep(test::stepOf("s", absent, item->hash)).error().message(), HasSubstr("before_ap"));
    EXPECT_THAT(store->addStep(test::stepOf("s", item->hash, absent)).error().message(), HasSubstr("result"));
    EXPECT_FALSE(store->addStep(test::stepOf("s", "xyz", item->hash)).ok());
    EXPECT_FALSE(store->addStep(test::stepOf("", item->hash, item->hash)).ok());
    Step step = test::stepOf("s", item->hash, item->hash);
    step.options_json = "{broken";
    EXPECT_THAT(store->addStep(step).error().message(), HasSubstr("options_json"));
    step = test::stepOf("s", item->hash, item->hash);
    step.finished_utc = "yesterday";
    EXPECT_THAT(store->addStep(step).error().message(), HasSubstr("finished_utc"));
    EXPECT_FALSE(store->addDecision({.step = item->record, .accepted = true, .who = "A", .why = "B"}).ok());
    EXPECT_FALSE(store->addDecision({.step = 99, .accepted = true, .who = "A", .why = "B"}).ok());
    const Result<Step> good = store->addStep(test::stepOf("s", item->hash, item->hash));
    ASSERT_OK(good);
    EXPECT_FALSE(store->addDecision({.step = good->record, .accepted = true, .who = "", .why = "B"}).ok());
    EXPECT_FALSE(store->addDecision({.step = good->record, .accepted = true, .who = "A", .why = ""}).ok());
    EXPECT_FALSE(store->addDecision({.step = good->record, .accepted = true, .who = "\xff", .why = "B"}).ok());
    for (const char* name : {"", ".", "..", "../a", "a/b", "/etc/passwd", "a\\b", ".hidden", "a\nb"}) {
        EXPECT_FALSE(store->addItem({.schema = "a/1", .file_name = name}, "{}").ok()) << name;
    }
    EXPECT_FALSE(store->bytes(absent).ok());
    EXPECT_EQ(store->info()->records, 3);  // nothing of all that left a trace
    EXPECT_TRUE(store->verify({}, Progress::none())->whole());

    store = CaseStore::open(path_, Access::read);
    ASSERT_OK(store);
    EXPECT_THROW(static_cast<void>(store->addItem({.schema = "a/1", .file_name = "b"}, "{}")), std::logic_error);
}

TEST_F(CaseStoreTest, NothingIsOverwritten) {
    write("notes.txt", "my notes");
    EXPECT_THAT(CaseStore::create(scratch_ / "notes.txt", "x").error().message(), HasSubstr("overwritten"));
    EXPECT_FALSE(CaseStore::open(scratch_ / "notes.txt", Access::write).ok());
    write("long.txt", std::string(20000, 'n'));
    EXPECT_THAT(CaseStore::open(scratch_ / "long.txt", Access::write).error().message(),
                HasSubstr("case of FluoroCut"));
    EXPECT_EQ(textOf("notes.txt"), "my notes");
    EXPECT_EQ(textOf("long.txt"), std::string(20000, 'n'));
    write("empty", "");
    EXPECT_FALSE(CaseStore::create(scratch_ / "empty", "x").ok());
    EXPECT_FALSE(CaseStore::open(scratch_ / "empty", Access::write).ok());
    EXPECT_EQ(textOf("empty"), "");
    // Another program's database.
    EXPECT_EQ(RawFile(scratch_ / "other.db").run("CREATE TABLE t (a); INSERT INTO t VALUES (1)"), "");
    const std::string other = textOf("other.db");
    EXPECT_THAT(CaseStore::open(scratch_ / "other.db", Access::write).error().message(),
                HasSubstr("a file of another kind"));
    EXPECT_EQ(textOf("other.db"), other);
    // A case whose file is gone but whose log is not: SQLite would play it into the new one.
    write("hip.fluorocut-wal", "left over");
    EXPECT_THAT(CaseStore::create(path_, "x").error().message(), HasSubstr("-wal"));
    EXPECT_FALSE(std::filesystem::exists(path_));
    EXPECT_FALSE(CaseStore::open(scratch_ / "absent", Access::read).ok());
    EXPECT_FALSE(std::filesystem::exists(scratch_ / "absent"));
    EXPECT_FALSE(CaseStore::open(scratch_.path(), Access::read).ok());
    EXPECT_FALSE(CaseStore::create(scratch_ / "no_folder" / "a", "x").ok());
}

TEST_F(CaseStoreTest, OneWriterManyReaders) {
    Result<CaseStore> writer = CaseStore::create(path_, "one");
    ASSERT_OK(writer);
    EXPECT_THAT(CaseStore::open(path_, Access::write).error().message(),
                HasSubstr("open for writing in another place"));
    std::filesystem::create_symlink(path_, scratch_ / "link");
    EXPECT_FALSE(CaseStore::open(scratch_ / "link", Access::write).ok());  // whatever name leads there
    Result<CaseStore> reader = CaseStore::open(path_, Access::read);
    ASSERT_OK(reader);
    ASSERT_OK(test::fill(*writer, 1));
    EXPECT_EQ(reader->info()->records, 5);
    EXPECT_TRUE(reader->verify({}, Progress::none())->whole());
    { const CaseStore closed = std::move(*writer); }
    EXPECT_OK(CaseStore::open(path_, Access::write));
}

TEST_F(CaseStoreTest, ANewerVersionIsLeftAlone) {
    ASSERT_OK(CaseStore::create(path_, "newer"));
    EXPECT_EQ(RawFile(path_).run("PRAGMA user_version = 3"), "");
    EXPECT_THAT(CaseStore::open(path_, Access::write).error().message(), HasSubstr("newer FluoroCut"));
    EXPECT_FALSE(CaseStore::open(path_, Access::read).ok());
}

// A file cut short or with bytes turned over opens or does not, but never crashes nor passes for whole where it counts.
TEST_F(CaseStoreTest, DamagedFilesAreNoticed) {
    {
        Result<CaseStore> store = CaseStore::create(path_, "damage");
        ASSERT_OK(store);
        ASSERT_OK(test::fill(*store, 3));
    }
    const std::string good = textOf("hip.fluorocut");
    for (std::size_t size = 0; size < good.size(); size += 1777) {
        write("cut", good.substr(0, size));
        const Result<CaseStore> store = CaseStore::open(scratch_ / "cut", Access::read);
        if (!store) continue;
        const Result<CaseCheck> check = store->verify({}, Progress::none());
        EXPECT_TRUE(!check || !check->whole()) << size;
    }
    const std::size_t at = good.find("pixels of 1");
    ASSERT_NE(at, std::string::npos);
    std::string bad = good;
    bad[at + 3] = '!';
    write("turned", bad);
    const Result<CaseStore> store = CaseStore::open(scratch_ / "turned", Access::read);
    ASSERT_OK(store);
    const Result<CaseCheck> check = store->verify({}, Progress::none());
    ASSERT_OK(check);
    ASSERT_TRUE(check->fault.has_value());
    EXPECT_EQ(check->fault->record, 6);  // the second image
    EXPECT_THAT(check->fault->what, HasSubstr("content that was changed"));
    const std::string hash = store->content()->items[2].hash;
    EXPECT_THAT(store->bytes(hash).error().message(), HasSubstr("another hash"));
}

TEST_F(CaseStoreTest, RecordsAsJson) {
    Result<CaseStore> store = CaseStore::create(path_, "json");
    ASSERT_OK(store);
    ASSERT_OK(test::fill(*store, 1));
    const nlohmann::json json = nlohmann::json::parse(store->recordsJson().value());
    ASSERT_EQ(json["records"].size(), 5U);
    // The chain can be checked from the text alone, as the header describes it.
    std::string previous;
    for (const nlohmann::json& record : json["records"]) {
        std::string text;
        for (const std::string& field :
             {std::to_string(record["number"].get<int>()), record["recorded_utc"].get<std::string>(),
              record["kind"].get<std::string>(), record["body"].get<std::string>(), previous})
            text += std::to_string(field.size()) + ":" + field + ",";
        EXPECT_EQ(record["previous"], previous);
        previous = sha256(text);
        EXPECT_EQ(record["hash"], previous);
    }
}

}  // namespace
}  // namespace fluorocut

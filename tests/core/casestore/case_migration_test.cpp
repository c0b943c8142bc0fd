// A case of schema version 1, made here by hand, comes to the present version with all it held.
#include <gmock/gmock.h>

#include "core/casestore/case_store.h"
#include "core/casestore/sha256.h"
#include "tests/core/casestore/case_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::RawFile;
using testing::HasSubstr;
using Access = CaseStore::Access;

// The tables of version 1, written out once more: this text must never change, whatever becomes of the code.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE blob (hash TEXT NOT NULL PRIMARY KEY, content BLOB NOT NULL) STRICT;
CREATE TRIGGER blob_is_new BEFORE INSERT ON blob WHEN EXISTS (SELECT 1 FROM blob WHERE hash = NEW.hash)
    BEGIN SELECT RAISE(ABORT, 'content is never replaced'); END;
CREATE TRIGGER blob_stays BEFORE UPDATE ON blob BEGIN SELECT RAISE(ABORT, 'content is never changed'); END;
CREATE TRIGGER blob_remains BEFORE DELETE ON blob BEGIN SELECT RAISE(ABORT, 'content is never removed'); END;
CREATE TABLE record (number INTEGER PRIMARY KEY, recorded_utc TEXT NOT NULL, kind TEXT NOT NULL, body TEXT NOT NULL,
    previous TEXT NOT NULL, hash TEXT NOT NULL) STRICT;
CREATE TRIGGER record_follows BEFORE INSERT ON record
    WHEN NEW.number <> (SELECT coalesce(max(number), 0) + 1 FROM record)
        OR NEW.previous <> coalesce((SELECT hash FROM record ORDER BY number DESC LIMIT 1), '')
    BEGIN SELECT RAISE(ABORT, 'records are only appended'); END;
CREATE TRIGGER record_stays BEFORE UPDATE ON record BEGIN SELECT RAISE(ABORT, 'records are never changed'); END;
CREATE TRIGGER record_remains BEFORE DELETE ON record BEGIN SELECT RAISE(ABORT, 'records are never removed'); END;
)sql";

class CaseMigrationTest : public testing::Test {
  protected:
    // created, an image, its pose, the step between them, a decision on it.
    void SetUp() override {
        RawFile file(path_);
        ASSERT_EQ(file.run("PRAGMA application_id = 1179403092; PRAGMA user_version = 1;" + std::string(kVersion1)),
                  "");
        for (const std::string& content : {pixels_, pose_}) {
            ASSERT_EQ(file.run("INSERT INTO blob VALUES ('" + sha256(content) + "', CAST('" + content + "' AS BLOB))"),
                      "");
        }
        const std::string image = sha256(pixels_), pose = sha256(pose_);
        append(file, "created", R"({"label": "old", "id": "00112233", "software": "FluoroCut 0.0.9"})");
        append(
            file, "item",
            R"({"kind": "image", "schema": "image/png", "file_name": "ap.png", "bytes": 6, "hash": ")" + image + "\"}");
        append(file, "item",
               R"({"kind": "pose", "schema": "fluorocut/pose/1", "file_name": "p.json", "bytes": 7, "hash": ")" + pose +
                   "\"}");
        append(file, "step",
               R"({"name": "register", "inputs": [{"role": "ap", "hash": ")" + image +
                   R"("}], "options_json": "{\"a\": 0.10}", "result": ")" + pose +
                   R"(", "started_utc": "2025-01-02T03:04:05.006Z", "finished_utc": "2025-01-02T03:04:06.000Z",)"
                   R"( "software": "FluoroCut 0.0.9"})");
        append(file, "decision", R"({"step": 4, "verdict": "accepted", "who": "A", "why": "fits"})");
    }
    void append(RawFile& file, const std::string& kind, const std::string& body) {
        const std::string number = std::to_string(++count_), time = "2025-01-02T03:04:0" + number + ".000Z";
        std::string text;
        for (const std::string& field : {number, time, kind, body, previous_})
            text += std::to_string(field.size()) + ":" + field + ",";
        const std::string hash = sha256(text);
        ASSERT_EQ(file.run("INSERT INTO record VALUES (" + number + ", '" + time + "', '" + kind + "', '" + body +
                           "', '" + previous_ + "', '" + hash + "')"),
                  "");
        previous_ = hash;
    }
    std::string recordsInFile() const {
        return RawFile(path_).ask(
            "SELECT number || recorded_utc || kind || body || previous || hash FROM record WHERE "
            "number <= 5 ORDER BY number");
    }
    void expectAllOfIt(const CaseStore& store) const {
        const Result<CaseContent> content = store.content();
        ASSERT_OK(content);
        ASSERT_EQ(content->items.size(), 2U);
        EXPECT_EQ(store.bytes(content->items[0].hash).value(), pixels_);
        EXPECT_EQ(store.bytes(content->items[1].hash).value(), pose_);
        EXPECT_EQ(content->items[0].recorded_utc, "2025-01-02T03:04:02.000Z");
        ASSERT_EQ(content->steps.size(), 1U);
        EXPECT_EQ(content->steps[0].options_json, "{\"a\": 0.10}");
        EXPECT_EQ(content->steps[0].software, "FluoroCut 0.0.9");
        EXPECT_EQ(content->steps[0].result, content->items[1].hash);
        const std::optional<Step> accepted = lastAccepted(*content, "register");
        ASSERT_TRUE(accepted.has_value());
        EXPECT_EQ(accepted->record, 4);
        EXPECT_TRUE(store.verify({.known_hash = previous_}, Progress::none())->whole());
    }

    test::ScratchFolder scratch_;
    std::filesystem::path path_ = scratch_ / "old.fluorocut";
    std::string pixels_ = "pixels", pose_ = "a pose!", previous_;
    int count_ = 0;
};

TEST_F(CaseMigrationTest, KeepsEverything) {
    const std::string before = recordsInFile();
    {
        const Result<CaseStore> store = CaseStore::open(path_, Access::write);
        ASSERT_OK(store);
        EXPECT_EQ(store->info()->schema_version, 2);
        EXPECT_EQ(store->info()->label, "old");
        EXPECT_EQ(store->info()->records, 6);  // and one that tells of it
        expectAllOfIt(*store);
    }
    EXPECT_EQ(recordsInFile(), before);  // not a letter of the old ones
    EXPECT_EQ(RawFile(path_).ask("PRAGMA user_version"), "2\n");
    EXPECT_THAT(RawFile(path_).ask("SELECT body FROM record WHERE number = 6"), HasSubstr("\"from_schema\":1"));
    // Once only, and from then on like any other.
    Result<CaseStore> store = CaseStore::open(path_, Access::write);
    ASSERT_OK(store);
    EXPECT_EQ(store->info()->records, 6);
    ASSERT_OK(test::fill(*store, 1));
    EXPECT_EQ(store->info()->records, 10);
    EXPECT_TRUE(store->verify({.known_hash = previous_}, Progress::none())->whole());
}

TEST_F(CaseMigrationTest, ReadingLeavesTheFileAsItIs) {
    const Result<CaseStore> store = CaseStore::open(path_, Access::read);
    ASSERT_OK(store);
    EXPECT_EQ(store->info()->schema_version, 1);
    expectAllOfIt(*store);
    EXPECT_EQ(RawFile(path_).ask("PRAGMA user_version"), "1\n");
}

TEST_F(CaseMigrationTest, AnAlteredCaseIsNotMadeToLookWhole) {
    ASSERT_EQ(RawFile(path_).run("DROP TRIGGER record_stays; UPDATE record SET recorded_utc = '2024' WHERE number = 3"),
              "");
    const Result<CaseStore> store = CaseStore::open(path_, Access::write);
    ASSERT_FALSE(store.ok());
    EXPECT_THAT(store.error().message(), HasSubstr("record 3 was changed"));
    EXPECT_EQ(RawFile(path_).ask("PRAGMA user_version"), "1\n");
}

}  // namespace
}  // namespace fluorocut

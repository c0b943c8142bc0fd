// Whatever is done to a case's file behind its back shows; what is asked politely is refused.
#include <map>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/casestore/case_store.h"
#include "core/casestore/sha256.h"
#include "tests/core/casestore/case_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::RawFile;
using testing::HasSubstr;

constexpr int kRounds = 10;
constexpr std::int64_t kRecords = 1 + 4 * kRounds;

class AuditChainTest : public testing::Test {
  protected:
    void SetUp() override {
        Result<CaseStore> store = CaseStore::create(path_, "audit");
        ASSERT_OK(store);
        ASSERT_OK(test::fill(*store, kRounds));
    }
    CaseCheck check(const std::filesystem::path& path, const std::string& known = {}) const {
        const Result<CaseStore> store = CaseStore::open(path, CaseStore::Access::read);
        EXPECT_OK(store);
        if (!store) return {};
        const Result<CaseCheck> checked = store->verify({.known_hash = known}, Progress::none());
        EXPECT_OK(checked);
        return checked ? *checked : CaseCheck();
    }
    test::ScratchFolder scratch_;
    std::filesystem::path path_ = scratch_ / "audit.fluorocut";
};

// Off with the triggers, and afterwards on with them again, so that only what was done in between can show.
std::string withoutTriggers(RawFile& file, const std::string& sql) {
    const std::string triggers = file.ask("SELECT sql || ';' FROM sqlite_master WHERE type = 'trigger'");
    const std::string names =
        file.ask("SELECT 'DROP TRIGGER ' || name || ';' FROM sqlite_master WHERE type = 'trigger'");
    return file.run("BEGIN; " + names + sql + "; " + triggers + " COMMIT");
}

// The record's hash as anybody could compute it who has read the header.
std::string hashInFile(RawFile& file, std::int64_t number) {
    const auto field = [&](const std::string& column) {
        std::string text = file.ask("SELECT " + column + " FROM record WHERE number = " + std::to_string(number));
        text.pop_back();
        return std::to_string(text.size()) + ":" + text + ",";
    };
    return sha256(field("number") + field("recorded_utc") + field("kind") + field("body") + field("previous"));
}

// One of ten ways to harm a case; says which record must be named, 0 for none in particular.
struct Harm {
    std::string sql;
    std::int64_t record = 0;
};

Harm harmOf(int way, Random& random, RawFile& file) {
    const auto pick = [&](std::int64_t least, std::int64_t most) {
        return least + static_cast<std::int64_t>(random.below(static_cast<std::uint64_t>(most - least + 1)));
    };
    const auto text = [](std::int64_t number) { return std::to_string(number); };
    const std::int64_t one = pick(1, kRecords - 1), other = pick(one + 1, kRecords);
    switch (way) {
        case 0: {  // one letter of one text
            const char* columns[] = {"recorded_utc", "kind", "body", "previous", "hash"};
            const std::int64_t column = one == 1 ? pick(0, 2) : pick(0, 4);  // the first one has nothing before it
            const std::string name = columns[column];
            const std::int64_t length =
                file.number("SELECT length(" + name + ") FROM record WHERE number = " + text(one));
            const std::int64_t at = pick(1, length);
            return {"UPDATE record SET " + name + " = substr(" + name + ", 1, " + text(at - 1) + ") || CASE substr(" +
                        name + ", " + text(at) + ", 1) WHEN '7' THEN '8' ELSE '7' END || substr(" + name + ", " +
                        text(at + 1) + ") WHERE number = " + text(one),
                    one};
        }
        case 1:  // one gone from the middle
            return {"DELETE FROM record WHERE number = " + text(one), one};
        case 2:  // the newest ones gone
            return {"DELETE FROM record WHERE number > " + text(one), one + 1};
        case 3:  // two have changed places, hashes and all
            return {"UPDATE record SET number = -1 WHERE number = " + text(one) +
                        "; UPDATE record SET number = " + text(one) + " WHERE number = " + text(other) +
                        "; UPDATE record SET number = " + text(other) + " WHERE number = -1",
                    one};
        case 4:  // one gone and the numbers closed up
            return {"DELETE FROM record WHERE number = " + text(one) +
                        "; UPDATE record SET number = -number WHERE number > " + text(one) +
                        "; UPDATE record SET number = -number - 1 WHERE number < 0",
                    one};
        case 5:  // two have changed what they say
            return {
                "CREATE TEMP TABLE t AS SELECT number, body FROM record; UPDATE record SET body = (SELECT body "
                "FROM temp.t WHERE t.number = " +
                    text(other) + ") WHERE number = " + text(one) +
                    "; UPDATE record SET body = (SELECT body FROM temp.t WHERE t.number = " + text(one) +
                    ") WHERE number = " + text(other),
                one};
        case 6: {  // content changed, each is named by one item first
            const std::int64_t item = 2 + 4 * pick(0, kRounds - 1) + pick(0, 1);
            return {
                "UPDATE blob SET content = CAST('?' || substr(CAST(content AS TEXT), 2) AS BLOB) WHERE hash = "
                "(SELECT json_extract(body, '$.hash') FROM record WHERE number = " +
                    text(item) + ")",
                item};
        }
        case 7: {  // content gone
            const std::int64_t item = 2 + 4 * pick(0, kRounds - 1) + pick(0, 1);
            return {"DELETE FROM blob WHERE hash = (SELECT json_extract(body, '$.hash') FROM record WHERE number = " +
                        text(item) + ")",
                    item};
        }
        case 8:  // one more at the end, made up
            return {
                "INSERT INTO record SELECT number + 1, recorded_utc, kind, body, hash, hash FROM record WHERE "
                "number = " +
                    text(kRecords) + "; UPDATE head SET number = number + 1",
                kRecords + 1};
        default:  // content that nobody added
            return {"INSERT INTO blob VALUES ('" + sha256(text(one)) + "', x'3" + text(pick(0, 9)) + "')", 0};
    }
}

TEST_F(AuditChainTest, SixtyWaysToHarmAllShow) {
    ASSERT_TRUE(check(path_).whole());
    std::map<int, int> tried;
    for (int seed = 0; seed < 60; ++seed) {
        const std::filesystem::path copy = scratch_ / ("harmed_" + std::to_string(seed));
        std::filesystem::copy_file(path_, copy);
        Random random(static_cast<std::uint64_t>(seed));
        std::int64_t expected = 0;
        {
            RawFile file(copy);
            const Harm harm = harmOf(seed % 10, random, file);
            ASSERT_EQ(withoutTriggers(file, harm.sql), "") << harm.sql;
            expected = harm.record;
        }
        const CaseCheck found = check(copy);
        ++tried[seed % 10];
        ASSERT_TRUE(found.fault.has_value()) << "seed " << seed;
        EXPECT_FALSE(found.whole());
        EXPECT_EQ(found.fault->record.value_or(0), expected) << "seed " << seed << ": " << found.fault->what;
        std::filesystem::remove(copy);
    }
    EXPECT_EQ(tried.size(), 10U);
}

// The same alterations with nothing done at all must not show: the fault above is not of the tools.
TEST_F(AuditChainTest, TriggersTakenOffAndPutBackAreTheSame) {
    {
        RawFile file(path_);
        ASSERT_EQ(withoutTriggers(file, "SELECT 1"), "");
    }
    const CaseCheck found = check(path_);
    EXPECT_TRUE(found.whole()) << (found.fault ? found.fault->what : "");
    EXPECT_EQ(found.records, kRecords);
    EXPECT_EQ(found.contents, 2 * kRounds);
}

// Somebody who computes the record's own hash anew is found out by the record after it, ...
TEST_F(AuditChainTest, ARecordHashedAnewBreaksTheNext) {
    {
        RawFile file(path_);
        ASSERT_EQ(
            withoutTriggers(file, "UPDATE record SET body = replace(body, 'accepted', 'refused') WHERE number = 5"),
            "");
        ASSERT_EQ(check(path_).fault->record, 5);
        ASSERT_EQ(withoutTriggers(file, "UPDATE record SET hash = '" + hashInFile(file, 5) + "' WHERE number = 5"), "");
    }
    const CaseCheck found = check(path_);
    ASSERT_TRUE(found.fault.has_value());
    EXPECT_EQ(found.fault->record, 6);
    EXPECT_THAT(found.fault->what, HasSubstr("does not follow"));
}

// ... and who does so with all of them, by the hash that was kept elsewhere.
TEST_F(AuditChainTest, ARewrittenCaseIsFoundByAKeptHash) {
    const std::string kept = check(path_).newest_hash;
    EXPECT_TRUE(check(path_, kept).whole());
    {
        RawFile file(path_);
        ASSERT_EQ(
            withoutTriggers(file, "UPDATE record SET body = replace(body, 'accepted', 'refused') WHERE number = 5"),
            "");
        std::string previous = file.ask("SELECT hash FROM record WHERE number = 4");
        previous.pop_back();
        for (std::int64_t number = 5; number <= kRecords; ++number) {
            const std::string where = " WHERE number = " + std::to_string(number);
            ASSERT_EQ(withoutTriggers(file, "UPDATE record SET previous = '" + previous + "'" + where), "");
            previous = hashInFile(file, number);
            ASSERT_EQ(withoutTriggers(file, "UPDATE record SET hash = '" + previous + "'" + where), "");
        }
        ASSERT_EQ(withoutTriggers(file, "UPDATE head SET hash = '" + previous + "'"), "");
    }
    EXPECT_TRUE(check(path_).whole());  // what the header says that the chain alone cannot show
    EXPECT_THAT(check(path_, kept).fault->what, HasSubstr("was rewritten"));
}

TEST_F(AuditChainTest, TriggersRefuseFromAnyProgram) {
    {
        RawFile file(path_);
        for (const char* sql :
             {"UPDATE record SET body = '{}' WHERE number = 3", "UPDATE record SET number = 99 WHERE number = 41",
              "DELETE FROM record WHERE number = 41", "DELETE FROM record", "UPDATE blob SET content = x'00'",
              "DELETE FROM blob", "REPLACE INTO record SELECT * FROM record WHERE number = 41",
              "REPLACE INTO blob SELECT hash, x'00' FROM blob",
              "INSERT INTO record SELECT 43, recorded_utc, kind, body, hash, hash FROM record WHERE number = 41",
              "INSERT INTO record SELECT 42, recorded_utc, kind, body, previous, hash FROM record WHERE number = 41",
              "UPDATE head SET number = 40", "UPDATE head SET hash = ''", "DELETE FROM head",
              "REPLACE INTO head VALUES (1, 40, '')"}) {
            EXPECT_NE(file.run(sql), "") << sql;
        }
    }
    EXPECT_TRUE(check(path_).whole());
}

TEST_F(AuditChainTest, MissingOrChangedTablesShow) {
    for (const char* sql :
         {"DROP TRIGGER record_stays", "CREATE TABLE more (a)", "CREATE INDEX i ON record (kind)",
          "DROP TRIGGER blob_remains; CREATE TRIGGER blob_remains BEFORE DELETE ON blob BEGIN SELECT 1; "
          "END"}) {
        std::filesystem::copy_file(path_, scratch_ / "changed", std::filesystem::copy_options::overwrite_existing);
        ASSERT_EQ(RawFile(scratch_ / "changed").run(sql), "");
        const CaseCheck found = check(scratch_ / "changed");
        ASSERT_TRUE(found.fault.has_value()) << sql;
        EXPECT_THAT(found.fault->what, HasSubstr("tables")) << sql;
    }
    for (const char* sql : {"DROP TABLE head", "DROP TABLE blob", "DROP TABLE record"}) {
        std::filesystem::copy_file(path_, scratch_ / "changed", std::filesystem::copy_options::overwrite_existing);
        ASSERT_EQ(RawFile(scratch_ / "changed").run(std::string("DROP TRIGGER record_is_newest; ") + sql), "");
        EXPECT_TRUE(check(scratch_ / "changed").fault.has_value()) << sql;
    }
}

}  // namespace
}  // namespace fluorocut

// Credentials, and the log that can't be changed unnoticed.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "server/auth/access_database.h"
#include "server/auth/gate.h"
#include "tests/support/temporary_directory.h"

namespace remesh {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::TemporaryDirectory;

constexpr Time kNoon{std::chrono::hours(500'000)};

Papers bearer(const std::string& token) {
    return {"Bearer " + token, {}, "test"};
}

AuditEntry entry(const std::string& action) {
    return {kNoon, "clinic", "token:1", "ipv4:127.0.0.1:1", action, "job-1", "OK"};
}

class Auth : public ::testing::Test {
protected:
    TemporaryDirectory directory_;
};

TEST_F(Auth, LetsATokenInToItsTenantWithItsRole) {
    const auto issued =
        AccessStore(directory_.path()).create_token({"clinic", Role::Viewer, "", {}}, kNoon);
    Gate gate(directory_.path(), true);

    const Principal who = gate.admit(bearer(issued.token), Role::Viewer, "GetJob");

    EXPECT_EQ(who.tenant, "clinic");
    EXPECT_EQ(who.actor(), "token:" + issued.credential.id);
    EXPECT_THROW(static_cast<void>(gate.admit(bearer(issued.token), Role::User, "CreateJob")),
                 AccessError);
}

TEST_F(Auth, LetsInNobodyElse) {
    const auto issued =
        AccessStore(directory_.path()).create_token({"clinic", Role::User, "", {}}, kNoon);
    Gate gate(directory_.path(), true);
    std::string almost = issued.token;
    almost.back() = almost.back() == '0' ? '1' : '0';

    EXPECT_THROW(static_cast<void>(gate.admit({}, Role::Viewer, "")), AccessError);
    EXPECT_THROW(static_cast<void>(gate.admit(bearer(""), Role::Viewer, "")), AccessError);
    EXPECT_THROW(static_cast<void>(gate.admit(bearer(almost), Role::Viewer, "")), AccessError);
    EXPECT_THROW(static_cast<void>(gate.admit({issued.token, {}, ""}, Role::Viewer, "")),
                 AccessError);
}

TEST_F(Auth, IsForTheDefaultTenantWhereNoCredentialsAreAskedFor) {
    Gate gate(directory_.path(), false);

    EXPECT_EQ(gate.admit({}, Role::User, "").tenant, kDefaultTenant);
    EXPECT_THROW(static_cast<void>(gate.admit(bearer("wrong"), Role::Viewer, "")), AccessError);
}

TEST_F(Auth, KeepsNoToken) {
    const auto issued =
        AccessStore(directory_.path()).create_token({"clinic", Role::User, "", {}}, kNoon);

    for (const auto& file : std::filesystem::directory_iterator(directory_.path())) {
        std::ifstream stream(file.path(), std::ios::binary);
        const std::string content{std::istreambuf_iterator<char>(stream), {}};
        EXPECT_THAT(content, Not(HasSubstr(issued.token.substr(7)))) << file.path();
    }
}

TEST_F(Auth, EndsATokenAtItsTimeAndWhenItIsRevoked) {
    AccessStore access(directory_.path());
    const auto brief =
        access.create_token({"a", Role::User, "", kNoon + std::chrono::hours(1)}, kNoon);
    const auto revoked = access.create_token({"a", Role::User, "", {}}, kNoon);

    EXPECT_TRUE(access.revoke(revoked.credential.id, kNoon).has_value());

    EXPECT_TRUE(access.find_token(brief.token, kNoon).has_value());
    EXPECT_FALSE(access.find_token(brief.token, kNoon + std::chrono::hours(1)).has_value());
    EXPECT_FALSE(access.find_token(revoked.token, kNoon).has_value());
    EXPECT_FALSE(access.is_valid(revoked.credential.id, kNoon));
    EXPECT_FALSE(access.revoke(revoked.credential.id, kNoon).has_value());
}

TEST_F(Auth, MakesAKeyForAPurposeOnce) {
    const std::string pages = AccessStore(directory_.path()).key_for("pages");
    AccessStore again(directory_.path());

    EXPECT_EQ(pages.size(), 64U);
    EXPECT_EQ(again.key_for("pages"), pages);
    EXPECT_NE(again.key_for("other"), pages);
}

TEST_F(Auth, TakesUpTheDatabaseOfAnOlderVersion) {
    const auto issued =
        AccessStore(directory_.path()).create_token({"clinic", Role::User, "", {}}, kNoon);
    open_access_database(directory_.path()).execute("DROP TABLE keys; PRAGMA user_version = 1");

    AccessStore access(directory_.path());

    EXPECT_TRUE(access.find_token(issued.token, kNoon).has_value());
    EXPECT_EQ(access.key_for("pages").size(), 64U);
}

TEST_F(Auth, LetsInCertificatesByName) {
    AccessStore(directory_.path())
        .allow_certificate("pipeline.clinic.example", {"clinic", Role::User, "", {}}, kNoon);
    Gate gate(directory_.path(), true);

    const Principal who =
        gate.admit({{}, {"other", "pipeline.clinic.example"}, ""}, Role::User, "");

    EXPECT_EQ(who.tenant, "clinic");
    EXPECT_THROW(static_cast<void>(gate.admit({{}, {"other"}, ""}, Role::Viewer, "")), AccessError);
}

TEST_F(Auth, RefusesNamesThatCantBeTenants) {
    AccessStore access(directory_.path());

    for (const std::string& name :
         std::vector<std::string>{"", "../x", "A", "a b", std::string(65, 'a')}) {
        EXPECT_THROW(access.create_token({name, Role::User, "", {}}, kNoon), std::invalid_argument);
    }
}

TEST_F(Auth, WritesDownRefusalsOnceASecond) {
    Time now = kNoon;
    Gate gate(directory_.path(), true, [&now] { return now; });
    const auto knock = [&gate] {
        EXPECT_THROW(static_cast<void>(gate.admit({}, Role::Viewer, "GetJob")), AccessError);
    };

    for (int i = 0; i < 100; ++i) {
        knock();
    }
    now += std::chrono::seconds(1);
    knock();

    std::vector<std::string> subjects;
    AuditLog(directory_.path()).for_each([&](const AuditRecord& record) {
        subjects.push_back(record.entry.subject);
    });
    EXPECT_THAT(subjects, ::testing::ElementsAre("", "99 more before"));
}

TEST_F(Auth, WritesDownRefusalsAlsoWhenTheClockWasSetBack) {
    Time now = kNoon;
    Gate gate(directory_.path(), true, [&now] { return now; });
    for (int i = 0; i < 2; ++i) {
        EXPECT_THROW(static_cast<void>(gate.admit({}, Role::Viewer, "GetJob")), AccessError);
        now -= std::chrono::hours(24);
    }

    EXPECT_EQ(AuditLog(directory_.path()).verify().entries, 2);
}

TEST_F(Auth, LetsFewStrangersPassToWhereTheyAreWrittenDown) {
    Time now = kNoon;
    const auto issued =
        AccessStore(directory_.path()).create_token({"clinic", Role::Viewer, "", {}}, kNoon);
    Gate gate(directory_.path(), true, [&now] { return now; });

    for (int i = 0; i < Gate::kStrangers; ++i) {
        EXPECT_NO_THROW(gate.require_acquaintance({}));
    }

    EXPECT_THROW(gate.require_acquaintance({}), AccessError);
    EXPECT_THROW(gate.require_acquaintance(bearer("remesh_1")), AccessError);
    EXPECT_NO_THROW(gate.require_acquaintance(bearer(issued.token)));
    now += std::chrono::minutes(1);
    EXPECT_NO_THROW(gate.require_acquaintance({}));
    EXPECT_THROW(static_cast<void>(gate.admit({}, Role::Viewer, "GetJob")), AccessError);
    EXPECT_THROW(gate.require_acquaintance({}), AccessError);

    std::vector<std::string> subjects;
    AuditLog(directory_.path()).for_each([&](const AuditRecord& record) {
        subjects.push_back(record.entry.subject);
    });
    EXPECT_THAT(subjects, ::testing::ElementsAre("2 more before"));
}

TEST_F(Auth, LetsStrangersPassAlsoWhenTheClockWasSetBack) {
    Time now = kNoon;
    Gate gate(directory_.path(), true, [&now] { return now; });
    for (int i = 0; i < Gate::kStrangers; ++i) {
        gate.require_acquaintance({});
    }

    now -= std::chrono::hours(24);

    EXPECT_NO_THROW(gate.require_acquaintance({}));
}

TEST_F(Auth, VerifiesALogThatNobodyTouched) {
    AuditLog log(directory_.path());
    for (const char* action : {"CreateJob", "CancelJob", "DeleteJob"}) {
        log.append(entry(action));
    }

    const AuditVerdict verdict = log.verify();

    EXPECT_EQ(verdict.entries, 3);
    EXPECT_THAT(verdict.trouble, IsEmpty());
}

TEST_F(Auth, KeepsOneChainThoughManyThreadsWrite) {
    AuditLog log(directory_.path());
    AuditLog other(directory_.path());
    {
        std::vector<std::jthread> threads;
        for (int i = 0; i < 8; ++i) {
            threads.emplace_back([&, i] {
                for (int k = 0; k < 10; ++k) {
                    (i % 2 == 0 ? log : other).append(entry("CreateJob"));
                }
            });
        }
    }

    const AuditVerdict verdict = log.verify();

    EXPECT_EQ(verdict.entries, 80);
    EXPECT_THAT(verdict.trouble, IsEmpty());
}

/// A log with four entries, and somebody who has the file and knows SQL.
class TamperedLog : public Auth {
protected:
    TamperedLog() {
        AuditLog log(directory_.path());
        for (const char* action : {"CreateJob", "DownloadArtifact", "CancelJob", "DeleteJob"}) {
            log.append(entry(action));
        }
        honest_ = log.verify();
    }

    void run(const char* sql) {
        auto connection = open_access_database(directory_.path());
        connection.execute("DROP TRIGGER IF EXISTS audit_keeps_rows");
        connection.execute("DROP TRIGGER IF EXISTS audit_keeps_values");
        connection.execute(sql);
    }
    std::string trouble() { return AuditLog(directory_.path()).verify().trouble; }

    AuditVerdict honest_;
};

TEST_F(TamperedLog, TellsThatAnEntryWasChanged) {
    run("UPDATE audit SET actor = 'token:2' WHERE sequence = 2");

    EXPECT_THAT(trouble(), HasSubstr("entry 2 doesn't have its hash"));
}

TEST_F(TamperedLog, TellsThatAnEntryWasTakenOut) {
    run("DELETE FROM audit WHERE sequence = 2");

    EXPECT_THAT(trouble(), HasSubstr("entry 3 follows entry 1"));
}

TEST_F(TamperedLog, TellsThatEntriesWereNumberedAnew) {
    run("DELETE FROM audit WHERE sequence = 2;"
        "UPDATE audit SET sequence = sequence - 1 WHERE sequence > 2");

    EXPECT_THAT(trouble(), HasSubstr("entry 2 doesn't have its hash"));
}

TEST_F(TamperedLog, TellsByAHeadThatTheEndWasCutOff) {
    run("DELETE FROM audit WHERE sequence > 2");

    EXPECT_THAT(trouble(), IsEmpty());
    EXPECT_THAT(AuditLog(directory_.path()).verify(honest_.entries, honest_.head).trouble,
                HasSubstr("ends at entry 2 but once had 4"));
}

TEST_F(TamperedLog, TellsByAHeadThatItWasWrittenAnew) {
    run("DELETE FROM audit");
    AuditLog log(directory_.path());
    for (int i = 0; i < 4; ++i) {
        log.append(entry("CreateJob"));
    }

    EXPECT_THAT(trouble(), IsEmpty());
    EXPECT_THAT(log.verify(honest_.entries, honest_.head).trouble, HasSubstr("written anew"));
}

TEST_F(TamperedLog, CantBeChangedByMistake) {
    auto connection = open_access_database(directory_.path());

    EXPECT_THROW(connection.execute("DELETE FROM audit"), StoreError);
    EXPECT_THROW(connection.execute("UPDATE audit SET actor = ''"), StoreError);
}

}  // namespace
}  // namespace remesh

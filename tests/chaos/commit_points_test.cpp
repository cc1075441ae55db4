#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <string>

#include "server/jobs/housekeeper.h"
#include "server/jobs/lease_desk.h"
#include "server/jobs/registry.h"
#include "server/jobs/worker_pool.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/worker_roster.h"
#include "tests/chaos/crashing_store.h"
#include "tests/support/job_machine.h"
#include "tests/support/temporary_directory.h"

// A server is killed at every commit of a small session, before and after it. The next server must
// bring every job that was acknowledged to exactly one end, and leave no file behind or missing.

namespace remesh {
namespace {

namespace fs = std::filesystem;
using testing::CrashingStore;
using testing::ScriptedEngine;
using testing::TemporaryDirectory;
using testing::TextCodec;

JobResult tell_and_copy(const JobRequest& request, const JobFiles& input, RunContext& run,
                        OutputSink& outputs) {
    run.preview({.vertices = Points(input.surface.size(), Vec3::Zero())});
    run.sample({.quality = QualitySample{}});
    return ScriptedEngine::copy_input(request, input, run, outputs);
}

/// One life of a server over a directory.
class Life {
public:
    Life(const fs::path& directory, int crash_at)
        : file_(open_sqlite_store(directory / "store.sqlite")),
          store_(*file_, crash_at),
          artifacts_(directory, store_),
          roster_(directory),
          registry_(store_, artifacts_, codec_, engine_, {}),
          keeper_(store_, artifacts_, registry_, codec_,
                  [this](const std::string& worker) { return roster_.is_alive(worker); }, {}) {
        keeper_.take_up(system_now());
        keeper_.clean_up(system_now());
        roster_.tidy();
    }

    JobKey submit(const std::string& bytes) {
        ArtifactDraft draft = artifacts_.draft("clinic");
        draft.write(bytes);
        const ArtifactId input = draft.finish();
        artifacts_.add(std::move(draft), system_now());
        return registry_.submit({"clinic", "request " + bytes, TextCodec::spec(input, 0), false})
            .job.key;
    }
    void run_everything() {
        const WorkerEntry entry(roster_, "worker");
        LeaseDesk desk(store_, artifacts_, codec_, {.worker = "worker"});
        const auto feed = store_.follow();
        const WorkerPool pool(desk, artifacts_, codec_, engine_, {1, 1});
        while (!store_.list({"clinic", {JobState::Queued, JobState::Running, JobState::Cancelling}})
                    .empty()) {
            feed->next(std::chrono::seconds(1), {});
        }
        desk.drain();
    }

    JobStore& store() { return store_; }
    JobRegistry& registry() { return registry_; }
    ArtifactStore& artifacts() { return artifacts_; }

private:
    TextCodec codec_;
    ScriptedEngine engine_{tell_and_copy};
    std::unique_ptr<JobStore> file_;
    CrashingStore store_;
    ArtifactStore artifacts_;
    WorkerRoster roster_;
    JobRegistry registry_;
    Housekeeper keeper_;
};

/// What was acknowledged, kept where a kill doesn't reach it.
class Diary {
public:
    explicit Diary(const fs::path& directory) : file_(directory / "diary") {}

    void write(const std::string& event, const std::string& value) const {
        std::ofstream(file_, std::ios::app) << event << '\t' << value << '\n' << std::flush;
    }
    [[nodiscard]] std::map<std::string, std::string> read() const {
        std::map<std::string, std::string> events;
        std::ifstream stream(file_);
        for (std::string line; std::getline(stream, line);) {
            events[line.substr(0, line.find('\t'))] = line.substr(line.find('\t') + 1);
        }
        return events;
    }

private:
    fs::path file_;
};

void live(const fs::path& directory, int crash_at) {
    const Diary diary(directory);
    Life life(directory, crash_at);
    for (const char* bytes : {"one", "two", "three"}) {
        diary.write(bytes, life.submit(bytes).id);
    }
    life.registry().cancel({"clinic", diary.read().at("three")});
    diary.write("cancelled", "");
    life.run_everything();
    life.registry().remove({"clinic", diary.read().at("two")}, {});
    diary.write("removed", "");
}

void check_job(Life& life, const JobKey& key, std::ostream& problems) {
    const auto job = life.store().find(key);
    if (!job) {
        problems << "lost " << key.id << '\n';
        return;
    }
    const auto events = life.store().events_after(key, 0, 1'000);
    const auto ends = std::count_if(events.begin(), events.end(), [](const StoredEvent& event) {
        return event.kind == EventKind::State && is_terminal(event.state);
    });
    if (!is_terminal(job->state) || ends != 1) {
        problems << key.id << " came to " << ends << " ends\n";
    }
}

void check_output(Life& life, const std::string& bytes, std::ostream& problems) {
    const auto output = life.artifacts().find("clinic", sha256_of("out:" + bytes));
    if (!output || life.artifacts().open("clinic", *output).bytes() != "out:" + bytes) {
        problems << "the output of " << bytes << " isn't there\n";
    }
}

void check_files(Life& life, const fs::path& directory, std::ostream& problems) {
    for (const auto& file : fs::directory_iterator(directory / "tenants/clinic/artifacts")) {
        const std::string name = file.path().filename().string();
        const auto artifact = life.artifacts().find("clinic", name);
        if (!artifact) {
            problems << "orphan " << name << '\n';
        } else if (sha256_of(life.artifacts().open("clinic", *artifact).bytes()) != name) {
            problems << "damaged " << name << '\n';
        }
    }
}

/// What a client and an operator find after the next start.
std::string problems_after(const fs::path& directory) {
    std::ostringstream problems;
    const auto told = Diary(directory).read();
    Life(directory, 0).run_everything();
    Life life(directory, 0);  // another start, which cleans up after the first one
    for (const char* bytes : {"one", "two", "three"}) {
        const auto acknowledged = told.find(bytes);
        if (acknowledged == told.end()) {
            continue;
        }
        const JobKey key{"clinic", acknowledged->second};
        const bool may_be_gone = std::string(bytes) == "two";
        if (!may_be_gone || life.store().find(key)) {
            check_job(life, key, problems);
            if (life.submit(bytes) != key) {
                problems << bytes << " runs twice\n";
            }
        }
        if (life.store().find(key) && life.store().find(key)->state == JobState::Succeeded) {
            check_output(life, bytes, problems);
        }
    }
    if (told.contains("cancelled") &&
        life.store().find({"clinic", told.at("three")})->state != JobState::Cancelled) {
        problems << "a cancelled job went on\n";
    }
    if (told.contains("removed") && life.store().find({"clinic", told.at("two")})) {
        problems << "a removed job came back\n";
    }
    if (fs::exists(directory / "tenants")) {
        check_files(life, directory, problems);
    }
    return problems.str();
}

/// Runs it in a process of its own. \return the status of its end
int in_child(const std::function<int()>& body) {
    const pid_t child = fork();
    if (child == 0) {
        int code = 1;
        try {
            code = body();
        } catch (const std::exception& error) {
            std::cerr << error.what() << std::endl;
        }
        std::_Exit(code);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return status;
}

TEST(CommitPoints, NoneOfThemLosesOrDoublesAJobWhenTheServerIsKilledThere) {
    int points = 0;
    for (bool is_killed = true; is_killed && points < 1'000;) {
        ++points;
        const TemporaryDirectory directory;
        const int end = in_child([&] {
            live(directory.path(), points);
            return 0;
        });
        is_killed = WIFSIGNALED(end) && WTERMSIG(end) == SIGKILL;
        ASSERT_TRUE(is_killed || (WIFEXITED(end) && WEXITSTATUS(end) == 0)) << "at " << points;

        const int next = in_child([&] {
            const std::string problems = problems_after(directory.path());
            std::cerr << problems << std::flush;
            return problems.empty() ? 0 : 1;
        });
        ASSERT_EQ(next, 0) << "after a kill at commit point " << points;
    }
    EXPECT_GT(points, 40);
    RecordProperty("points", points);
}

}  // namespace
}  // namespace remesh

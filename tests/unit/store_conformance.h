#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>

#include "server/store/job_store.h"
#include "tests/support/temporary_directory.h"

// What every engine of the store must do: what its tests share.

namespace remesh::testing {

inline const std::string kInput(64, 'a');
inline const std::string kOutput(64, 'b');
inline const std::string kPreview(64, 'c');

inline Time at(int second) {
    return Time(std::chrono::seconds(second));
}

inline NewJob job_named(const std::string& id, int priority = 0) {
    return {{"clinic", id}, "", "spec of " + id, priority, 3, {kInput}, "", false, ""};
}

inline Loss lost(int second) {
    return {.last_state = JobState::Quarantined, .outcome = "lost", .retry_time = at(second)};
}

inline Settlement success() {
    return {JobState::Succeeded, "done", {}, {{kOutput, 5}}};
}

/// A new engine adds its way to open it in store_conformance_test.cpp.
struct StoreEngine {
    std::string name;
    std::function<std::unique_ptr<JobStore>(const std::filesystem::path&)> open;
    bool is_durable = true;
};

class JobStoreConformance : public ::testing::TestWithParam<StoreEngine> {
protected:
    JobStoreConformance() { store->add_artifact("clinic", {kInput, 10}, {}, at(0)); }

    void reopen() {
        store.reset();
        store = GetParam().open(directory.path());
    }
    JobRecord create(const std::string& id, int priority = 0) {
        return *store->create(job_named(id, priority), {}, at(1)).job;
    }
    void create_for(const std::string& tenant, const std::string& id) {
        NewJob job = job_named(id);
        job.key.tenant = tenant;
        job.inputs.clear();
        store->create(job, {}, at(1));
    }
    std::optional<JobRecord> claim_at(int second) {
        return store->claim({"worker", std::nullopt}, at(second));
    }
    Claim claim() {
        const auto job = claim_at(2);
        return {job->key, job->epoch};
    }
    /// Tenants of the next `count` jobs that are claimed, one letter each.
    std::string claim_tenants(int count) {
        std::string tenants;
        for (int i = 0; i < count; ++i) {
            tenants += claim_at(2)->key.tenant;
        }
        return tenants;
    }
    JobState state(const std::string& id) { return store->find({"clinic", id})->state; }

    TemporaryDirectory directory;
    std::unique_ptr<JobStore> store = GetParam().open(directory.path());
};

}  // namespace remesh::testing

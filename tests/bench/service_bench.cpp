#include <benchmark/benchmark.h>

#include <fstream>
#include <latch>
#include <memory>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::Gate;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

/// Bytes that weren't there before, so that every upload is a real one.
std::string fresh_bytes(std::size_t size) {
    std::string bytes(size, 'x');
    bytes.replace(0, 32, random_hex(16));
    return bytes;
}

/// From the first byte of an upload to the first event of the job, on loopback.
void upload_to_first_event(benchmark::State& state) {
    TestServer server(kCopy);
    for (auto _ : state) {
        const v1::Job job = server.create(fresh_bytes(static_cast<std::size_t>(state.range(0))));
        server.watch(job.name(), 0, nullptr, [](const v1::JobEvent&) { return true; });
    }
}
BENCHMARK(upload_to_first_event)
    ->ArgName("bytes")
    ->Arg(1 << 20)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

/// A job whose engine does next to nothing: what the service costs.
void tiny_job(benchmark::State& state) {
    TestServer server(kCopy);
    for (auto _ : state) {
        server.watch(server.create(fresh_bytes(1'000)).name());
    }
}
BENCHMARK(tiny_job)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

/// As many small jobs as a batch has, from several clients at a time, each of which submits,
/// follows and fetches one after the other.
void jobs_of_clients(benchmark::State& state) {
    constexpr int kClients = 8;
    const auto jobs = static_cast<int>(state.range(0));
    for (auto _ : state) {
        TestServer server(kCopy,
                          [](ServerOptions& options) { options.workforce.workers.workers = 2; });
        std::vector<std::jthread> clients;
        for (int i = 0; i < kClients; ++i) {
            clients.emplace_back([&] {
                for (int k = 0; k < jobs / kClients; ++k) {
                    const auto events = server.watch(server.create(fresh_bytes(1'000)).name());
                    const auto& output = events.back().completed().result().outputs(0);
                    std::string bytes;
                    server.download(output.digest().sha256(), 0, 0, &bytes);
                }
            });
        }
    }
    state.SetItemsProcessed(state.iterations() * jobs);
}
BENCHMARK(jobs_of_clients)
    ->ArgName("jobs")
    ->Arg(1000)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

void upload(benchmark::State& state) {
    TestServer server(kCopy);
    for (auto _ : state) {
        server.upload(fresh_bytes(static_cast<std::size_t>(state.range(0))));
    }
    state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(upload)
    ->ArgName("bytes")
    ->Arg(100 << 20)
    ->Arg(400 << 20)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void download(benchmark::State& state) {
    TestServer server(kCopy);
    const auto digest = server.upload(fresh_bytes(static_cast<std::size_t>(state.range(0))));
    for (auto _ : state) {
        std::string bytes;
        server.download(digest.sha256(), 0, 0, &bytes);
        benchmark::DoNotOptimize(bytes.data());
    }
    state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(download)
    ->ArgName("bytes")
    ->Arg(100 << 20)
    ->Arg(400 << 20)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

double resident_mib() {
    std::ifstream status("/proc/self/statm");
    double total = 0.0;
    double resident = 0.0;
    status >> total >> resident;
    return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

/// A reader of one job's events that keeps none of them.
class Watcher final : public grpc::ClientReadReactor<v1::JobEvent> {
public:
    Watcher(v1::JobService::Stub& stub, const std::string& job, std::latch& opened,
            std::latch& done)
        : opened_(opened), done_(done) {
        request_.set_name(job);
        stub.async()->WatchJob(&context_, &request_, this);
        StartRead(&event_);
        StartCall();
    }
    void OnReadDone(bool ok) override {
        if (ok) {
            if (std::exchange(is_first_, false)) {
                opened_.count_down();
            }
            StartRead(&event_);
        }
    }
    void OnDone(const grpc::Status&) override { done_.count_down(); }

private:
    std::latch& opened_;
    std::latch& done_;
    grpc::ClientContext context_;
    v1::WatchJobRequest request_;
    v1::JobEvent event_;
    bool is_first_ = true;
};

/// Many readers of one job with 500 events, in this process, too: its memory is theirs and the
/// server's together.
void watchers(benchmark::State& state) {
    Gate gate;
    const ScriptedEngine engine([&gate](const JobRequest& request, const JobFiles& input,
                                        RunContext& run, OutputSink& outputs) {
        run.enter(Stage::Relax);
        gate.pass(run);
        for (int i = 0; i < 500; ++i) {
            run.sample({.quality = QualitySample{}});
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    const auto count = state.range(0);
    for (auto _ : state) {
        TestServer server(engine);
        const std::string job = server.create("mesh").name();
        server.wait_for(job, v1::Job::STATE_RUNNING);
        const double before = resident_mib();
        std::latch opened(count);
        std::latch done(count);
        std::vector<std::unique_ptr<Watcher>> readers;
        for (std::int64_t i = 0; i < count; ++i) {
            readers.push_back(std::make_unique<Watcher>(*server.jobs, job, opened, done));
        }
        opened.wait();
        state.counters["MiB_open"] = resident_mib() - before;
        gate.open();
        done.wait();
        state.counters["MiB_end"] = resident_mib() - before;
    }
}
BENCHMARK(watchers)
    ->ArgName("readers")
    ->Arg(10)
    ->Arg(1000)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace remesh

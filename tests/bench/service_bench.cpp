#include <benchmark/benchmark.h>

#include <string>

#include "tests/support/test_server.h"

namespace remesh {
namespace {

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

void upload(benchmark::State& state) {
    TestServer server(kCopy);
    for (auto _ : state) {
        server.upload(fresh_bytes(static_cast<std::size_t>(state.range(0))));
    }
    state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(upload)->ArgName("bytes")->Arg(100 << 20)->Unit(benchmark::kMillisecond)->UseRealTime();

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
BENCHMARK(download)->ArgName("bytes")->Arg(100 << 20)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace remesh

// Each stage and the whole pipeline on a ball of about so many thousand tets, and on real anatomy.
// `s_per_Mtet` is CPU seconds of the process per million tets, `B_per_tet` peak memory per tet
// (of the process so far: run one benchmark at a time with --benchmark_filter to read it).
#include <benchmark/benchmark.h>
#include <sys/resource.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>

#include "core/io/mesh_io.h"
#include "core/pipeline.h"
#include "core/stages/tetrahedralize.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

double cpu_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double peak_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// Edge length that gives about `thousands` * 1000 tets in the unit ball: 9 tets per h^3.
double edge_length_for(std::int64_t thousands) {
    return std::cbrt(9.0 * 4.0 / 3.0 * M_PI / (1e3 * static_cast<double>(thousands)));
}

/// What every stage needs from those before it, made once per size.
struct Prefix {
    double h;
    PrepareResult prepared{};
    FeatureSet features{};
    std::shared_ptr<const SizingField> sizing{};
    Particles darts{};
    Particles surface{};
    Particles lattice{};
    Particles relaxed{};

    explicit Prefix(std::int64_t thousands) : h(edge_length_for(thousands)) {
        RunContext run;
        prepared = prepare_surface(input(), h, {}, run);
        features = find_features(prepared, h, {}, run);
        sizing = build_sizing_field(domain(), features, h, {}, run).field;
        darts = seed_surface(domain(), features, *sizing, {}, run);
        surface = relax_surface(darts, domain(), features, *sizing, {}, run).particles;
        lattice = seed_volume(surface, domain(), *sizing, std::nullopt, {}, run);
        relaxed = relax_volume(lattice, domain(), *sizing, {}, run).particles;
    }

    const Domain& domain() const { return *prepared.domain; }
    static const SurfaceMesh& input() {
        static const SurfaceMesh ball = testing::icosphere(6);
        return ball;
    }
};

const Prefix& prefix(std::int64_t thousands) {
    static std::unique_ptr<Prefix> last;
    static std::int64_t last_size = 0;
    if (last_size != thousands) {
        last = std::make_unique<Prefix>(thousands);
        last_size = thousands;
    }
    return *last;
}

/// Runs `stage(prefix, run)` on state.range(1) threads.
template <typename Run>
void measure(benchmark::State& state, Run stage) {
    const Prefix& before = prefix(state.range(0));
    tbb::task_arena arena(static_cast<int>(state.range(1)));
    const double start = cpu_seconds();
    for (auto _ : state) {
        arena.execute([&] {
            RunContext run;
            stage(before, run);
        });
    }
    const double tets = 1e3 * static_cast<double>(state.range(0) * state.iterations());
    state.counters["s_per_Mtet"] = (cpu_seconds() - start) / tets * 1e6;
    state.SetItemsProcessed(static_cast<std::int64_t>(tets));
}

void prepare(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(prepare_surface(Prefix::input(), b.h, {}, run));
    });
}
void seed_surface_darts(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(seed_surface(b.domain(), b.features, *b.sizing, {}, run));
    });
}
void relax_on_surface(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(
            relax_surface(b.darts, b.domain(), b.features, *b.sizing, {}, run));
    });
}
void seed_lattice(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(seed_volume(b.surface, b.domain(), *b.sizing, {}, {}, run));
    });
}
void relax_in_volume(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(relax_volume(b.lattice, b.domain(), *b.sizing, {}, run));
    });
}
void delaunay(benchmark::State& state) {
    measure(state, [](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(tetrahedralize(b.relaxed.position, run));
    });
}
void carve(benchmark::State& state) {
    RunContext unstoppable;
    const auto tets = tetrahedralize(prefix(state.range(0)).relaxed.position, unstoppable);
    measure(state, [&](const Prefix& b, RunContext& run) {
        benchmark::DoNotOptimize(carve_domain(b.relaxed, tets, b.domain(), {}, run));
    });
}
void improve(benchmark::State& state) {
    RunContext unstoppable;
    const Prefix& b = prefix(state.range(0));
    const auto carved = carve_domain(b.relaxed, tetrahedralize(b.relaxed.position, unstoppable),
                                     b.domain(), {}, unstoppable);
    measure(state, [&](const Prefix& before, RunContext& run) {
        benchmark::DoNotOptimize(
            improve_mesh(carved, before.relaxed.anchor, before.domain(), before.features, {}, run));
    });
}

void run_whole(benchmark::State& state, const SurfaceMesh& input, double h, int threads) {
    tbb::task_arena arena(threads);
    const double start = cpu_seconds();
    double tets = 0.0;
    for (auto _ : state) {
        arena.execute([&] {
            RunContext run;
            tets +=
                static_cast<double>(run_pipeline(input, {.edge_length = h}, run).tets.tets.size());
        });
    }
    const double each = tets / static_cast<double>(state.iterations());
    state.counters["tets"] = each;
    state.counters["s_per_Mtet"] = (cpu_seconds() - start) / tets * 1e6;
    state.counters["B_per_tet"] = peak_bytes() / each;
    state.SetItemsProcessed(static_cast<std::int64_t>(tets));
}

void pipeline_ball(benchmark::State& state) {
    run_whole(state, Prefix::input(), edge_length_for(state.range(0)),
              static_cast<int>(state.range(1)));
}

SurfaceMesh ventricle() {
    std::ifstream file(REMESH_TEST_DATA_DIR "/left_lateral_ventricle.stl", std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    return read_surface(bytes, ".stl").mesh;
}

void pipeline_ventricle(benchmark::State& state) {
    run_whole(state, ventricle(), 1e-3 * static_cast<double>(state.range(0)),
              static_cast<int>(state.range(1)));
}

void surface_of_ventricle(benchmark::State& state) {
    const SurfaceMesh input = ventricle();
    const double h = 1e-3 * static_cast<double>(state.range(0));
    const double start = cpu_seconds();
    double triangles = 0.0;
    tbb::task_arena(1).execute([&] {
        for (auto _ : state) {
            RunContext run;
            const auto result = run_pipeline(input, {.edge_length = h, .tetrahedra = false}, run);
            triangles += static_cast<double>(result.surface.triangles.size());
        }
    });
    state.counters["triangles"] = triangles / static_cast<double>(state.iterations());
    state.counters["us_per_triangle"] = (cpu_seconds() - start) / triangles * 1e6;
}

void sizes(benchmark::internal::Benchmark* bench) {
    bench->ArgNames({"kilotets", "threads"})
        ->ArgsProduct({{100, 1000}, {1, 2}})
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime()
        ->Iterations(1);
}

BENCHMARK(prepare)->Apply(sizes);
BENCHMARK(seed_surface_darts)->Apply(sizes);
BENCHMARK(relax_on_surface)->Apply(sizes);
BENCHMARK(seed_lattice)->Apply(sizes);
BENCHMARK(relax_in_volume)->Apply(sizes);
BENCHMARK(delaunay)->Apply(sizes);
BENCHMARK(carve)->Apply(sizes);
BENCHMARK(improve)->Apply(sizes);
BENCHMARK(pipeline_ball)->Apply(sizes);
BENCHMARK(pipeline_ventricle)
    ->ArgNames({"micrometres", "threads"})
    ->ArgsProduct({{1200, 500}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);
BENCHMARK(surface_of_ventricle)
    ->ArgName("micrometres")
    ->Arg(1000)
    ->Arg(500)
    ->Arg(250)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

}  // namespace
}  // namespace remesh

#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <cstddef>

#include "core/run_context.h"

namespace remesh {

/// Rows per block. Fixed, so that sums are grouped alike for every number of threads.
inline constexpr std::size_t kGrain = 1024;

/// Calls `body(i)` for every i in [0, n), in any order and on any thread of the present arena.
///
/// A body writes only what belongs to its own i. Each block of rows is a checkpoint.
/// \throws Error{Cancelled}, and whatever `body` throws
template <typename Body>
void for_each_index(std::size_t n, const RunContext& run, Body body) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, kGrain),
        [&](const tbb::blocked_range<std::size_t>& rows) {
            run.checkpoint();
            for (std::size_t i = rows.begin(); i != rows.end(); ++i) {
                body(i);
            }
        },
        tbb::simple_partitioner());
}

/// Calls `body(begin, end)` for blocks of at most `grain` rows, the same blocks for any number of
/// threads: for bodies that keep scratch memory from row to row.
template <typename Body>
void for_each_block(std::size_t n, std::size_t grain, const RunContext& run, Body body) {
    const std::size_t blocks = (n + grain - 1) / grain;
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
        run.checkpoint();
        const std::size_t begin = block * grain;
        body(begin, begin + grain < n ? begin + grain : n);
    });
}

/// Sum of `term(i)` over [0, n), grouped the same way for any number of threads.
template <typename Term>
double sum_over(std::size_t n, Term term) {
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, n, kGrain), 0.0,
        [&](const tbb::blocked_range<std::size_t>& rows, double sum) {
            for (std::size_t i = rows.begin(); i != rows.end(); ++i) {
                sum += term(i);
            }
            return sum;
        },
        [](double a, double b) { return a + b; });
}

/// Largest `term(i)` over [0, n), at least `least`.
template <typename Term>
double max_over(std::size_t n, double least, Term term) {
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, n, kGrain), least,
        [&](const tbb::blocked_range<std::size_t>& rows, double best) {
            for (std::size_t i = rows.begin(); i != rows.end(); ++i) {
                const double value = term(i);
                best = value > best ? value : best;
            }
            return best;
        },
        [](double a, double b) { return a > b ? a : b; });
}

}  // namespace remesh

#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <vector>

#include "client/transfer.h"
#include "remesh/v1/job.pb.h"

namespace remesh::client {

/// What every command that makes jobs is told.
struct JobArguments {
    std::vector<std::string> inputs{};   ///< Paths; "-" is stdin.
    std::vector<std::string> formats{};  ///< Words for formats wanted back.
    std::string size_image{};            ///< Path of an image of sizes, or empty.
    v1::JobSpec spec{};                  ///< All but inputs and outputs.
    bool wants_estimate = false;         ///< Only say what it would need.
};

/// Adds the inputs, --format, --input-format and every flag that says how to remesh.
///
/// A flag that isn't given leaves its field of the spec absent, so that the defaults stay the
/// server's. `arguments` must outlive the parsing.
void add_job_arguments(CLI::App& command, JobArguments& arguments);

/// The image of sizes, if one was given. \throws Failure{BadInput} if it can't be read
[[nodiscard]] std::optional<InputFile> open_size_image(const JobArguments& arguments);

}  // namespace remesh::client

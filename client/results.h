#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/connection.h"
#include "client/pending_file.h"

namespace remesh::client {

/// One output of a job and where it shall go.
struct Delivery {
    v1::Output output{};
    std::filesystem::path target{};
};

/// What a job made; of one that broke a bound, its drafts.
[[nodiscard]] const google::protobuf::RepeatedPtrField<v1::Output>& outputs_of(const v1::Job& job);

/// The output a format names: tets where there are both. \throws Failure{BadInput} if there is none
[[nodiscard]] const v1::Output& output_in(const v1::Job& job, v1::Format format);

/// The one output of that kind. \throws Failure{BadInput} if there is none
[[nodiscard]] const v1::Output& output_of(const v1::Job& job, v1::Output::Kind kind);

/// The output whose suggested name has the extension of `path`, tets before surfaces; ".json" is
/// the report. \throws Failure{BadInput} that lists what there is
[[nodiscard]] const v1::Output& output_for(const v1::Job& job, const std::filesystem::path& path);
/// The report as a page for a name in .html, else as JSON.
[[nodiscard]] const v1::Output& report_for(const v1::Job& job, const std::filesystem::path& path);

/// Downloads everything, and only when all of it is there, puts it in place.
void deliver(Connection& connection, const std::vector<Delivery>& deliveries);

/// "a.vtu (12.3 MB), b.ply (1.2 MB)"
[[nodiscard]] std::string delivery_words(const std::vector<Delivery>& deliveries);

}  // namespace remesh::client

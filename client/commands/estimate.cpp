#include "client/commands/estimate.h"

#include <fmt/format.h>

#include <cstdio>

#include "client/json.h"
#include "client/tables.h"
#include "client/text.h"

namespace remesh::client {

void tell_estimate(const JobFiles& files, const v1::JobSpec& spec, Connection& server,
                   const Settings& settings) {
    const v1::Job job = estimate_job(server, files, spec);
    fmt::print("{}", settings.json
                         ? json_line(job) + "\n"
                         : estimate_card(sanitised(files.surface.path().string()), job.estimate()));
    std::fflush(stdout);
}

}  // namespace remesh::client

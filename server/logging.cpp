#include "server/logging.h"

#include <google/protobuf/stubs/logging.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <utility>

namespace remesh {

void set_up_log(const std::string& level) {
    auto logger = spdlog::stderr_logger_mt("remeshd");
    logger->set_pattern("time=%Y-%m-%dT%H:%M:%S.%eZ level=%l %v", spdlog::pattern_time_type::utc);
    logger->set_level(spdlog::level::from_str(level));
    logger->flush_on(spdlog::level::info);
    spdlog::set_default_logger(std::move(logger));
    // Of requests that aren't valid it would write a line each, before anybody knows who calls.
    google::protobuf::SetLogHandler(nullptr);
}

}  // namespace remesh

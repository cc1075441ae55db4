#pragma once

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sstream>
#include <string>
#include <vector>

#include "tests/service/client_fake_server.h"
#include "tests/service/client_process.h"

namespace remesh::client {

inline std::vector<nlohmann::json> json_lines(const std::string& text) {
    std::vector<nlohmann::json> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) {
        lines.push_back(nlohmann::json::parse(line));
    }
    return lines;
}

inline v1::Failure failure_with(const std::string& reason, const std::string& message) {
    v1::Failure failure;
    failure.set_reason(reason);
    failure.set_message(message);
    return failure;
}

/// A scripted server, and a folder that holds one input.
class Client : public ::testing::Test {
protected:
    ClientResult remesh(std::vector<std::string> arguments, const std::string& input = {}) {
        arguments.insert(arguments.begin(), {"--server", server_.address()});
        return run_client(folder_, arguments, {.input = input});
    }

    FakeServer server_;
    TemporaryFolder folder_;
    std::string input_ = folder_.file("in.stl", "solid in");
};

}  // namespace remesh::client

#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace remesh::client {

/// A folder that is gone at the end of the test.
class TemporaryFolder {
public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// Makes a file and returns its path.
    [[nodiscard]] std::string file(const std::string& name, const std::string& content) const;
    [[nodiscard]] std::vector<std::string> names() const;  ///< Of what is inside, sorted.

private:
    std::filesystem::path path_;
};

/// Empty if there is no such file.
[[nodiscard]] std::string content_of(const std::filesystem::path& file);

/// Waits until the file has `text`, for at most half a minute; returns its content then.
std::string wait_for_text(const std::filesystem::path& file, const std::string& text);

struct ClientResult {
    int exit_code = -1;  ///< -1 if a signal killed it.
    std::string out{};
    std::string err{};
    [[nodiscard]] std::string last_error_line() const;
};

struct ProcessOptions {
    std::string input{};                     ///< What stdin holds.
    std::vector<std::string> environment{};  ///< "NAME=VALUE", besides TMPDIR and PATH.
    std::string program = REMESH_CLIENT_PROGRAM;
};

/// The real client program (or another), in a folder of its own as working and temporary folder.
class ClientProcess {
public:
    ClientProcess(const TemporaryFolder& folder, const std::vector<std::string>& arguments,
                  const ProcessOptions& options = {});
    ~ClientProcess();
    ClientProcess(const ClientProcess&) = delete;
    ClientProcess& operator=(const ClientProcess&) = delete;

    void send(int signal) const;
    [[nodiscard]] pid_t pid() const { return pid_; }
    void wait_for_error_text(const std::string& text) const {
        wait_for_text(streams_.path() / "err", text);
    }
    ClientResult wait();

private:
    TemporaryFolder streams_;
    pid_t pid_ = -1;
};

/// Runs the client to its end.
ClientResult run_client(const TemporaryFolder& folder, const std::vector<std::string>& arguments,
                        const ProcessOptions& options = {});

}  // namespace remesh::client

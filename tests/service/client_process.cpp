#include "tests/service/client_process.h"

#include <sys/inotify.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <poll.h>
#include <signal.h>
#include <sstream>
#include <stdexcept>
#include <unistd.h>

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

void redirect(const char* file, int flags, int to) {
    dup2(open(file, flags), to);
}

std::vector<char*> pointers(std::vector<std::string>& words) {
    std::vector<char*> raw;
    for (std::string& word : words) {
        raw.push_back(word.data());
    }
    raw.push_back(nullptr);
    return raw;
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "client-test-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
        throw std::runtime_error("can't make a folder");
    }
    path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

std::string TemporaryFolder::file(const std::string& name, const std::string& content) const {
    std::ofstream(path_ / name) << content;
    return path_ / name;
}

std::vector<std::string> TemporaryFolder::names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(path_)) {
        names.push_back(entry.path().filename());
    }
    std::sort(names.begin(), names.end());
    return names;
}

std::string content_of(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::stringstream content;
    content << stream.rdbuf();
    return content.str();
}

std::string wait_for_text(const fs::path& file, const std::string& text) {
    const int watch = inotify_init1(IN_CLOEXEC);
    inotify_add_watch(watch, file.parent_path().c_str(), IN_MODIFY | IN_CREATE);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
    std::string content = content_of(file);
    while (content.find(text) == std::string::npos && std::chrono::steady_clock::now() < deadline) {
        pollfd changed{watch, POLLIN, 0};
        poll(&changed, 1, 100);
        content = content_of(file);
    }
    close(watch);
    return content;
}

std::string ClientResult::last_error_line() const {
    const std::size_t end = err.find_last_not_of('\n');
    if (end == std::string::npos) {
        return {};
    }
    const std::size_t start = err.rfind('\n', end);
    return err.substr(start == std::string::npos ? 0 : start + 1, end - (start + 1) + 1);
}

ClientProcess::ClientProcess(const TemporaryFolder& folder,
                             const std::vector<std::string>& arguments,
                             const ProcessOptions& options) {
    const std::string in = streams_.file("in", options.input);
    const std::string out = streams_.file("out", "");
    const std::string err = streams_.file("err", "");
    std::vector<std::string> words{options.program};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<std::string> settings{"TMPDIR=" + folder.path().string(), "PATH=/usr/bin:/bin"};
    settings.insert(settings.end(), options.environment.begin(), options.environment.end());
    const std::vector<char*> raw_words = pointers(words);
    const std::vector<char*> raw_settings = pointers(settings);
    const char* const working_folder = folder.path().c_str();

    pid_ = fork();  // This process has threads: from here to exec only what is safe after a fork.
    if (pid_ == 0) {
        redirect(in.c_str(), O_RDONLY, STDIN_FILENO);
        redirect(out.c_str(), O_WRONLY, STDOUT_FILENO);
        redirect(err.c_str(), O_WRONLY, STDERR_FILENO);
        if (chdir(working_folder) == 0) {
            execve(raw_words.front(), raw_words.data(), raw_settings.data());
        }
        _exit(127);
    }
}

ClientProcess::~ClientProcess() {
    if (pid_ > 0) {
        kill(pid_, SIGKILL);
        waitpid(pid_, nullptr, 0);
    }
}

void ClientProcess::send(int signal) const {
    kill(pid_, signal);
}

ClientResult ClientProcess::wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(streams_.path() / "out"),
            content_of(streams_.path() / "err")};
}

ClientResult run_client(const TemporaryFolder& folder, const std::vector<std::string>& arguments,
                        const ProcessOptions& options) {
    return ClientProcess(folder, arguments, options).wait();
}

}  // namespace remesh::client

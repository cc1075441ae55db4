#include "client/private_server.h"

#include <fmt/format.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <signal.h>
#include <string_view>
#include <thread>
#include <unistd.h>
#include <vector>

#include "client/failure.h"
#include "client/text.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::string_view kFolderPrefix = "remesh-private-";
constexpr std::size_t kLongestSocketPath = 107;  // sockaddr_un.sun_path less its final zero.
constexpr auto kStartLimit = 30s;
constexpr auto kStopLimit = 5s;
constexpr auto kPollInterval = 2ms;

fs::path temporary_root() {
    std::error_code error;
    const fs::path root = fs::temp_directory_path(error);
    const std::size_t needed = root.string().size() + kFolderPrefix.size() + sizeof("/XXXXXX/s");
    return error || needed > kLongestSocketPath ? fs::path("/tmp") : root;
}

/// Takes the folder's lock, or returns none when somebody holds it.
UniqueFd lock_folder(const fs::path& folder) {
    // Not O_CLOEXEC: the child shall hold the lock, too.
    UniqueFd fd(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW));
    if (fd.is_open() && flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
        fd.reset();
    }
    return fd;
}

/// Removes what clients that were killed have left; they couldn't.
void remove_abandoned(const fs::path& root) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(root, ignored)) {
        if (!entry.path().filename().string().starts_with(kFolderPrefix)) {
            continue;
        }
        struct stat info {};
        const bool is_ours = lstat(entry.path().c_str(), &info) == 0 && S_ISDIR(info.st_mode) &&
                             info.st_uid == geteuid();
        if (is_ours && lock_folder(entry.path()).is_open()) {
            fs::remove_all(entry.path(), ignored);
        }
    }
}

std::string last_line(const fs::path& file) {
    std::ifstream stream(file);
    std::string last;
    for (std::string line; std::getline(stream, line);) {
        if (!line.empty()) {
            last = line;
        }
    }
    return sanitised(last);
}

/// In the child, between fork and exec: only calls that are safe there.
[[noreturn]] void become_server(const char* program, char* const* arguments, int log_fd,
                                pid_t parent) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) {
        _exit(127);  // The parent died before the line above.
    }
    setpgid(0, 0);  // Ctrl-C on the terminal is for the client, which then stops the server.
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    signal(SIGPIPE, SIG_DFL);
    const int null_fd = open("/dev/null", O_RDONLY);
    dup2(null_fd, STDIN_FILENO);
    dup2(log_fd, STDOUT_FILENO);
    dup2(log_fd, STDERR_FILENO);
    execv(program, arguments);
    _exit(127);
}

}  // namespace

PrivateServer::PrivateServer(const PrivateServerOptions& options, const std::stop_token& stop) {
    const auto program = options.program ? options.program : find_server_program();
    if (!program) {
        throw Failure(ExitCode::Local,
                      "no server was named (--server, REMESH_SERVER) and no remeshd was found to "
                      "start one (--remeshd, REMESH_REMESHD)");
    }
    if (access(program->c_str(), X_OK) != 0) {
        throw system_failure(fmt::format("can't start {}", program->string()));
    }
    const fs::path root = temporary_root();
    remove_abandoned(root);
    std::string name = (root / kFolderPrefix).string() + "XXXXXX";
    if (mkdtemp(name.data()) == nullptr) {
        throw system_failure(fmt::format("can't make a folder in {}", root.string()));
    }
    folder_ = name;
    lock_ = lock_folder(folder_);
    try {
        start(*program, options.threads);
        wait_until_listening(stop);
    } catch (...) {
        this->stop();
        throw;
    }
}

PrivateServer::~PrivateServer() {
    stop();
}

void PrivateServer::start(const fs::path& program, int threads) {
    std::vector<std::string> words{program.string(), "serve",   "--data-dir", folder_ / "data",
                                   "--listen",       address(), "--workers",  "1"};
    if (threads > 0) {
        words.insert(words.end(), {"--threads", std::to_string(threads)});
    }
    std::vector<char*> arguments;
    for (std::string& word : words) {
        arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    const UniqueFd log_fd(open(log().c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
    const pid_t parent = getpid();
    child_ = fork();
    if (child_ == 0) {
        become_server(words.front().c_str(), arguments.data(), log_fd.get(), parent);
    }
    if (child_ < 0) {
        throw system_failure("can't start a process");
    }
}

void PrivateServer::wait_until_listening(const std::stop_token& stop) {
    const auto deadline = std::chrono::steady_clock::now() + kStartLimit;
    while (!fs::is_socket(socket())) {
        if (const auto reason = post_mortem()) {
            throw Failure(ExitCode::Local, "the private server " + *reason);
        }
        if (stop.stop_requested()) {
            throw Failure(ExitCode::Interrupted, "interrupted");
        }
        if (std::chrono::steady_clock::now() > deadline) {
            throw Failure(ExitCode::Local, "the private server didn't start: " + last_line(log()));
        }
        std::this_thread::sleep_for(kPollInterval);
    }
}

bool PrivateServer::has_exited() {
    if (child_ > 0 && wait4(child_, &exit_status_, WNOHANG, nullptr) == child_) {
        child_ = -1;
    }
    return child_ < 0;
}

std::optional<std::string> PrivateServer::post_mortem() {
    if (!has_exited()) {
        return std::nullopt;
    }
    const std::string said = last_line(log());
    return fmt::format(
        "{} {}{}{}", WIFSIGNALED(exit_status_) ? "was killed by signal" : "ended with status",
        WIFSIGNALED(exit_status_) ? WTERMSIG(exit_status_) : WEXITSTATUS(exit_status_),
        said.empty() ? "" : ": ", said);
}

void PrivateServer::stop() {
    if (!has_exited()) {
        kill(child_, SIGTERM);
        const auto deadline = std::chrono::steady_clock::now() + kStopLimit;
        while (!has_exited() && std::chrono::steady_clock::now() < deadline) {
            std::this_thread::sleep_for(kPollInterval);
        }
    }
    if (!has_exited()) {
        kill(child_, SIGKILL);
        wait4(child_, &exit_status_, 0, nullptr);
        child_ = -1;
    }
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
}

std::optional<fs::path> find_server_program() {
    std::error_code error;
    const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
    std::vector<fs::path> folders;
    if (!error) {
        folders = {here, here / "../server", here / "../bin", here / "../sbin"};
    }
    const char* path = std::getenv("PATH");
    std::string_view rest = path == nullptr ? "" : path;
    while (!rest.empty()) {
        const std::size_t length = std::min(rest.find(':'), rest.size());
        folders.emplace_back(rest.substr(0, length));
        rest.remove_prefix(std::min(length + 1, rest.size()));
    }
    for (const fs::path& folder : folders) {
        const fs::path candidate = folder / "remeshd";
        if (fs::is_regular_file(candidate, error) && access(candidate.c_str(), X_OK) == 0) {
            return candidate;
        }
    }
    return std::nullopt;
}

}  // namespace remesh::client

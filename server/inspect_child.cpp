#include <sys/resource.h>
#include <sys/wait.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <functional>
#include <iostream>
#include <iterator>
#include <new>
#include <spawn.h>
#include <stdexcept>
#include <type_traits>
#include <unistd.h>
#include <utility>
#include <vector>

#include "core/error.h"
#include "server/convert.h"
#include "server/inspect.h"
#include "server/jobs/process_memory.h"

namespace remesh {
namespace {

constexpr std::int64_t kMaxMemory = std::int64_t{6} << 30;
constexpr rlim_t kMaxSeconds = 60;
constexpr rlim_t kMaxFile = rlim_t{3} << 29U;  // Images are files in memory while they are read.

// What the child writes: one of these, and what belongs to it.
constexpr char kAnswered = 'a';  // the answer
constexpr char kFailed = 'f';    // a digit for the ErrorCode, and a sentence

class Descriptor {
public:
    explicit Descriptor(int fd = -1) : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor& operator=(Descriptor&&) = delete;
    ~Descriptor() { close(); }

    void close() {
        if (fd_ >= 0) {
            ::close(std::exchange(fd_, -1));
        }
    }
    [[nodiscard]] int get() const { return fd_; }

private:
    int fd_;
};

struct Pipe {
    Descriptor read_end;
    Descriptor write_end;
};

Pipe make_pipe() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw std::runtime_error("can't make a pipe");
    }
    return {Descriptor(ends[0]), Descriptor(ends[1])};
}

pid_t start(std::vector<std::string> words, const Pipe& in, const Pipe& out) {
    std::vector<char*> arguments;
    for (std::string& word : words) {
        arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    std::array<char*, 1> environment{nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, in.read_end.get(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, out.write_end.get(), STDOUT_FILENO);
    pid_t child = -1;
    const int error = ::posix_spawn(&child, words.front().c_str(), &actions, nullptr,
                                    arguments.data(), environment.data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
        throw std::runtime_error("can't start a process to inspect a file");
    }
    return child;
}

/// A child that dies leaves the rest unread: what it said before counts.
void send(const Descriptor& to, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(to.get(), bytes.data(), bytes.size());
        if (written < 0 && errno != EINTR) {
            return;
        }
        bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
    }
}

std::string receive(const Descriptor& from) {
    std::string all;
    std::array<char, 4096> buffer{};
    while (true) {
        const ssize_t got = ::read(from.get(), buffer.data(), buffer.size());
        if (got > 0) {
            all.append(buffer.data(), static_cast<std::size_t>(got));
        } else if (got == 0 || errno != EINTR) {
            return all;
        }
    }
}

std::string understood(const std::string& said, int status) {
    if (!said.empty() && said[0] == kAnswered && WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        return said.substr(1);
    }
    if (said.size() > 2 && said[0] == kFailed) {
        throw Error(static_cast<ErrorCode>(said[1] - '0'), said.substr(2));
    }
    if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)) {
        throw Error(ErrorCode::TooLarge, "looking at this file takes more than a minute");
    }
    throw Error(ErrorCode::Internal,
                "the reader failed on this file, which is a defect; a job with it would fail, too");
}

/// Starts a process, sends it a question and waits for its answer.
std::string ask(std::vector<std::string> words, const std::vector<std::string_view>& question) {
    Pipe in = make_pipe();
    Pipe out = make_pipe();
    const pid_t child = start(std::move(words), in, out);
    in.read_end.close();
    out.write_end.close();
    for (const std::string_view piece : question) {
        send(in.write_end, piece);
    }
    in.write_end.close();
    const std::string said = receive(out.read_end);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return understood(said, status);
}

/// In the child: answers the question on stdin, within limits.
int answer(const std::function<std::string(std::string_view question)>& think) {
    const auto limit = [](auto resource, rlim_t most) {
        const rlimit both{most, most};
        ::setrlimit(resource, &both);
    };
    limit_address_space(kMaxMemory);
    limit(RLIMIT_CPU, kMaxSeconds);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_FSIZE, kMaxFile);
    const auto fail = [](ErrorCode code, const std::string& message) {
        std::cout << kFailed << static_cast<int>(code) << message << std::flush;
        return EXIT_FAILURE;
    };
    try {
        const std::string question{std::istreambuf_iterator<char>(std::cin), {}};
        const std::string said = think(question);
        std::cout << kAnswered << said << std::flush;
        return EXIT_SUCCESS;
    } catch (const Error& error) {
        return fail(error.code(), error.what());
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::TooLarge, "looking at this file takes more memory than is allowed");
    }
}

template <typename T>
T read_value(std::string_view& bytes) {
    T value{};
    if (bytes.size() < sizeof value) {
        throw Error(ErrorCode::Internal, "a process that looks at a file said something else");
    }
    std::memcpy(&value, bytes.data(), sizeof value);
    bytes.remove_prefix(sizeof value);
    return value;
}

/// Bytes after their number.
std::string_view read_piece(std::string_view& bytes) {
    const auto size = read_value<std::uint64_t>(bytes);
    const std::string_view piece = bytes.substr(0, size);
    bytes.remove_prefix(piece.size());
    return piece;
}

template <typename T>
std::string_view bytes_of(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

}  // namespace

Inspector inspector_in_child(const std::string& program) {
    return [program](std::string_view bytes, const std::string& hint) {
        v1::Inspection inspection;
        if (!inspection.ParseFromString(ask({program, "inspect-stdin", "--hint", hint}, {bytes}))) {
            throw Error(ErrorCode::Internal, "a process that looks at a file said something else");
        }
        return inspection;
    };
}

Estimator estimator_in_child(const std::string& program) {
    return [program](std::string_view spec, const JobFiles& inputs) {
        const std::uint64_t size = spec.size();
        const std::uint64_t surface_size = inputs.surface.size();
        const std::string said =
            ask({program, "estimate-stdin"},
                {bytes_of(size), spec, bytes_of(surface_size), inputs.surface, inputs.size_image});
        std::string_view rest = said;
        return read_value<JobEstimate>(rest);
    };
}

int serve_inspection(const std::string& hint) {
    return answer([&](std::string_view question) {
        return inspect_surface(question, hint).SerializeAsString();
    });
}

int serve_estimate(const Engine& engine) {
    return answer([&](std::string_view question) {
        const std::string_view spec = read_piece(question);
        const std::string_view surface = read_piece(question);
        const JobEstimate estimate =
            engine.estimate(ProtoCodec().decode_spec(spec), {surface, question});
        return std::string(bytes_of(estimate));
    });
}

}  // namespace remesh

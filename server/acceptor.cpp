#include "server/acceptor.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <netdb.h>
#include <poll.h>
#include <stdexcept>
#include <unistd.h>
#include <utility>

namespace remesh {
namespace {

namespace fs = std::filesystem;

constexpr int kBacklog = 1'024;
// How long nobody is let in when there is no file descriptor left.
constexpr std::chrono::milliseconds kPause{100};

int new_listener(int family, const sockaddr* address, socklen_t size) {
    const int listener = ::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const int on = 1;
    if (listener >= 0 && ::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        ::bind(listener, address, size) == 0 && ::listen(listener, kBacklog) == 0) {
        return listener;
    }
    const int error = errno;
    if (listener >= 0) {
        ::close(listener);
    }
    errno = error;
    return -1;
}

int port_of(int listener) {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.ss_family == AF_INET6
                     ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                     : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

/// Sockets that the process has open.
int open_sockets() {
    int count = 0;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator("/proc/self/fd", error)) {
        std::error_code gone;
        count += fs::read_symlink(entry.path(), gone).native().starts_with("socket:") ? 1 : 0;
    }
    return count;
}

}  // namespace

Acceptor::Acceptor(std::string address, int max_connections)
    : address_(std::move(address)), max_connections_(max_connections) {
    if (address_.starts_with("unix:")) {
        listen_on_path(address_.substr(5));
    } else if (const auto colon = address_.rfind(':'); colon != std::string::npos) {
        std::string host = address_.substr(0, colon);
        if (host.starts_with('[') && host.ends_with(']')) {
            host = host.substr(1, host.size() - 2);
        }
        listen_on_host(host, address_.substr(colon + 1));
    }
    leave_fd_ = ::eventfd(0, EFD_CLOEXEC);
    if (listeners_.empty() || leave_fd_ < 0) {
        throw std::runtime_error(
            "can't listen on " + address_ + ": " +
            (trouble_.empty() ? "HOST:PORT or unix:PATH is wanted" : trouble_));
    }
}

Acceptor::~Acceptor() {
    stop();
    for (const int listener : listeners_) {
        ::close(listener);
    }
    ::close(leave_fd_);
    if (address_.starts_with("unix:")) {
        ::unlink(address_.c_str() + 5);
    }
}

void Acceptor::listen_on_path(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path) {
        trouble_ = "a socket's path must have 1 to " + std::to_string(sizeof address.sun_path - 1) +
                   " bytes";
        return;
    }
    std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
    if (fs::is_socket(path)) {
        ::unlink(path.c_str());  // Left by a server that was killed.
    }
    const int listener =
        new_listener(AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    if (listener < 0) {
        trouble_ = std::strerror(errno);
        return;
    }
    listeners_.push_back(listener);
    port_ = 1;
}

void Acceptor::listen_on_host(const std::string& host, const std::string& port) {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
    addrinfo* all = nullptr;
    if (const int error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &all); error != 0) {
        trouble_ = ::gai_strerror(error);
        return;
    }
    const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(all, &::freeaddrinfo);
    for (addrinfo* one = all; one != nullptr; one = one->ai_next) {
        if (port_ != 0) {  // All addresses of the host get the port that was chosen first.
            auto* address = reinterpret_cast<sockaddr_in*>(one->ai_addr);
            address->sin_port = htons(static_cast<std::uint16_t>(port_));
        }
        const int listener = new_listener(one->ai_family, one->ai_addr, one->ai_addrlen);
        if (listener < 0) {
            trouble_ = std::strerror(errno);
            continue;
        }
        listeners_.push_back(listener);
        port_ = port_of(listener);
    }
}

void Acceptor::start(Hand hand) {
    hand_ = std::move(hand);
    thread_ = std::thread([this] { run(); });
}

void Acceptor::stop() {
    if (thread_.joinable()) {
        ::eventfd_write(leave_fd_, 1);
        thread_.join();
    }
}

void Acceptor::run() {
    std::vector<pollfd> sources{{leave_fd_, POLLIN, 0}};
    for (const int listener : listeners_) {
        sources.push_back({listener, POLLIN, 0});
    }
    known_sockets_ = open_sockets();
    while (true) {
        ::poll(sources.data(), sources.size(), -1);
        if (sources[0].revents != 0) {
            return;
        }
        for (std::size_t i = 1; i < sources.size(); ++i) {
            if (sources[i].revents != 0) {
                take(sources[i].fd);
            }
        }
    }
}

void Acceptor::take(int listener) {
    const int connection = ::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (connection < 0) {
        const bool is_out = errno == EMFILE || errno == ENFILE || errno == ENOMEM;
        if (is_out) {
            pollfd leave{leave_fd_, POLLIN, 0};
            ::poll(&leave, 1, static_cast<int>(kPause.count()));
        }
        return;
    }
    // Those that ended meanwhile are counted out only when it matters.
    if (++known_sockets_ > max_connections_) {
        known_sockets_ = open_sockets();
    }
    if (known_sockets_ > max_connections_) {
        ::close(connection);
        --known_sockets_;
        return;
    }
    const int on = 1;
    ::setsockopt(connection, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    hand_(listener, connection);
}

}  // namespace remesh

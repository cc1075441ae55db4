#pragma once

#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace remesh {

/// Takes the connections of a gRPC server, up to a bound: beyond it they are closed at once.
///
/// gRPC 1.51 knows no such bound, and stops listening for good when the process has no file
/// descriptor left, so anybody who may connect could end the service.
class Acceptor {
public:
    /// Gets a listener and a connection from it, which it owns.
    using Hand = std::function<void(int listener, int connection)>;

    /// Listens.
    /// \param address          HOST:PORT, port 0 for any, or unix:PATH
    /// \param max_connections  counted over all sockets of the process
    /// \throws std::runtime_error that names the address if it can't be listened on
    Acceptor(std::string address, int max_connections);
    Acceptor(const Acceptor&) = delete;
    Acceptor& operator=(const Acceptor&) = delete;
    /// Stops listening.
    ~Acceptor();

    /// Chosen port; 1 for a Unix socket.
    [[nodiscard]] int port() const { return port_; }
    /// Begins to hand connections over.
    void start(Hand hand);
    /// Takes no more connections.
    void stop();

private:
    void listen_on_path(const std::string& path);
    void listen_on_host(const std::string& host, const std::string& port);
    void run();
    void take(int listener);

    const std::string address_;
    const int max_connections_;
    int port_ = 0;
    std::string trouble_{};  // why the last listener couldn't be made
    std::vector<int> listeners_;
    int leave_fd_ = -1;
    int known_sockets_ = 0;  // the thread's: at least as many as there are
    Hand hand_;
    std::thread thread_;
};

}  // namespace remesh

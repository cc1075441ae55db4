#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "client/connection.h"

namespace remesh::client {

/// Watches a job until it is terminal, and reconnects where the last stream ended.
///
/// \param after     only events after this sequence
/// \param longest   a stream is opened anew after this long, so that a server that vanished without
///                  a word is noticed; renewing loses nothing, and isn't silence of the server
/// \param on_event  gets every message, heartbeats too; a new connection opens with a snapshot
/// \return the terminal job
/// \throws Failure as Connection::retry does
v1::Job follow(Connection& connection, const std::string& name, std::int64_t after,
               const std::function<void(const v1::JobEvent&)>& on_event,
               Connection::Milliseconds longest = std::chrono::minutes(2));

}  // namespace remesh::client

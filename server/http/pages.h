#pragma once

namespace httplib {
class Server;
}

namespace remesh::http {

/// Serves the dashboard: its files, and its one page for every address inside it.
void add_pages(httplib::Server& server);

}  // namespace remesh::http

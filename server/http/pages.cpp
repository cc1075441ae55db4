#include "server/http/pages.h"

#include <algorithm>
#include <httplib.h>
#include <stdexcept>
#include <string>
#include <zlib.h>

#include "server/http/assets.h"
#include "server/http/respond.h"

namespace remesh::http {
namespace {

/// For the rare client that doesn't take gzip.
std::string inflated(std::string_view gzip) {
    z_stream stream{};
    if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) {
        throw std::runtime_error("zlib can't start");
    }
    std::string input(gzip);
    stream.next_in = reinterpret_cast<Bytef*>(input.data());
    stream.avail_in = static_cast<uInt>(input.size());
    std::string output;
    int status = Z_OK;
    while (status == Z_OK) {
        char block[1 << 14];
        stream.next_out = reinterpret_cast<Bytef*>(block);
        stream.avail_out = sizeof block;
        status = inflate(&stream, Z_NO_FLUSH);
        output.append(block, sizeof block - stream.avail_out);
    }
    inflateEnd(&stream);
    return output;
}

/// \param is_immutable  its name changes with its content
void send_asset(const Asset& asset, bool is_immutable, const httplib::Request& request,
                httplib::Response& response) {
    if (is_immutable) {
        response.set_header("Cache-Control", "public, max-age=31536000, immutable");
    } else {
        response.set_header("Cache-Control", "no-cache");
    }
    response.set_header("Vary", "Accept-Encoding");
    const bool takes_gzip =
        request.get_header_value("Accept-Encoding").find("gzip") != std::string::npos;
    if (!takes_gzip) {
        send(response, inflated(asset.gzip), std::string(asset.type));
        return;
    }
    response.set_header("Content-Encoding", "gzip");
    response.set_content_provider(
        asset.gzip.size(), std::string(asset.type),
        [bytes = asset.gzip](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
            return sink.write(bytes.data() + offset, length);
        });
}

const Asset* find(std::string_view path) {
    const auto assets = dashboard_assets();
    const auto found = std::find_if(assets.begin(), assets.end(),
                                    [&](const Asset& asset) { return asset.path == path; });
    return found == assets.end() ? nullptr : &*found;
}

}  // namespace

void add_pages(httplib::Server& server) {
    server.Get("/assets/.+", [](const httplib::Request& request, httplib::Response& response) {
        if (const Asset* asset = find(request.path)) {
            send_asset(*asset, true, request, response);
        } else {
            refuse(response, 404, "NOT_FOUND", "There is no such file.");
        }
    });
    server.Get(R"(/|/new|/sign-in|/jobs/[a-z0-9-]+/[a-z0-9-]+)", [](const httplib::Request& request,
                                                                    httplib::Response& response) {
        if (const Asset* page = find("/index.html")) {
            send_asset(*page, false, request, response);
        } else {
            refuse(response, 404, "NO_DASHBOARD", "This remeshd was built without the dashboard.");
        }
    });
}

}  // namespace remesh::http

#include "server/http/access.h"

#include <algorithm>
#include <httplib.h>

#include "server/http/respond.h"

namespace remesh::http {
namespace {

constexpr std::string_view kCookie = "remesh_token=";
constexpr std::string_view kBearer = "Bearer ";
// What a form of another site can't set, and a script of one only after asking, which we refuse.
constexpr const char* kOwnHeader = "X-Remesh";
constexpr std::size_t kMaxToken = 512;

constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Without port; "[::1]" keeps its brackets.
std::string_view host_of(std::string_view host) {
    const auto colon = host.rfind(':');
    return colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos
               ? host.substr(0, colon)
               : host;
}

bool names_this_machine(std::string_view host) {
    const auto is_octets = [](std::string_view text) {
        return std::all_of(text.begin(), text.end(),
                           [](char c) { return c == '.' || (c >= '0' && c <= '9'); });
    };
    return host == "localhost" || host == "[::1]" || (host.starts_with("127.") && is_octets(host));
}

}  // namespace

std::string token_of(const httplib::Request& request) {
    const std::string header = request.get_header_value("Authorization");
    if (header.starts_with(kBearer)) {
        const std::string token = header.substr(kBearer.size());
        return is_token(token) ? token : std::string();
    }
    const std::string cookies = request.get_header_value("Cookie");
    auto start = cookies.find(kCookie);
    while (start != std::string::npos && start > 0 && cookies[start - 1] != ' ' &&
           cookies[start - 1] != ';') {
        start = cookies.find(kCookie, start + 1);
    }
    if (start == std::string::npos) {
        return {};
    }
    start += kCookie.size();
    const std::string token = cookies.substr(start, cookies.find(';', start) - start);
    return is_token(token) ? token : std::string();
}

bool is_token(std::string_view text) {
    return !text.empty() && text.size() <= kMaxToken &&
           std::all_of(text.begin(), text.end(), [](char c) {
               return c > ' ' && c <= '~' && c != ';' && c != ',' && c != '"' && c != '\\';
           });
}

void set_token_cookie(const std::string& token, const AccessRules& rules,
                      httplib::Response& response) {
    std::string cookie = std::string(kCookie) + token + "; Path=/; HttpOnly; SameSite=Strict";
    if (rules.is_encrypted) {
        cookie += "; Secure";
    }
    if (token.empty()) {
        cookie += "; Max-Age=0";
    }
    response.set_header("Set-Cookie", cookie);
}

bool admit(const AccessRules& rules, const httplib::Request& request, httplib::Response& response) {
    const std::string host = request.get_header_value("Host");
    if (rules.loopback_only && !names_this_machine(host_of(host))) {
        refuse(response, 421, "WRONG_HOST",
               "This port serves this machine only: call it 127.0.0.1 or localhost.");
        return false;
    }
    const bool is_read = request.method == "GET" || request.method == "HEAD";
    if (!is_read && !request.has_header(kOwnHeader)) {
        refuse(response, 403, "HEADER_MISSING",
               "A request that changes something needs the header X-Remesh: 1.");
        return false;
    }
    return true;
}

void add_security_headers(httplib::Response& response) {
    if (!response.has_header("Content-Security-Policy")) {
        response.set_header("Content-Security-Policy", kPolicy);
    }
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("X-Frame-Options", "DENY");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header("Cross-Origin-Opener-Policy", "same-origin");
    response.set_header("Cross-Origin-Resource-Policy", "same-origin");
    if (!response.has_header("Cache-Control")) {
        response.set_header("Cache-Control", "no-store");
    }
}

}  // namespace remesh::http

#pragma once

#include <string>
#include <string_view>

namespace httplib {
struct Request;
struct Response;
}  // namespace httplib

namespace remesh::http {

/// Whose calls the HTTP port takes. Who a caller is, the API decides: a token goes there as it
/// came.
struct AccessRules {
    bool loopback_only = true;  ///< Only names of this machine as Host: a page elsewhere can't pose
                                ///< as us by its DNS.
    bool is_encrypted = false;  ///< By this port or by a proxy: the cookie is never sent in clear.
};

/// The bearer token of a request, from its Authorization header or the cookie of the sign-in page;
/// empty if there is none.
[[nodiscard]] std::string token_of(const httplib::Request& request);

/// Whether a text can be a token: printable, no separators of headers and cookies, not too long.
[[nodiscard]] bool is_token(std::string_view text);

/// Keeps a token in a cookie that scripts can't read and other sites can't send. An empty one
/// forgets it.
void set_token_cookie(const std::string& token, const AccessRules& rules,
                      httplib::Response& response);

/// Whether a request may be looked at: it names this host, and what changes something comes from
/// our own page or from a program, not from a form or script of another site. Answers it if not.
[[nodiscard]] bool admit(const AccessRules& rules, const httplib::Request& request,
                         httplib::Response& response);

/// Headers that every response has: nothing from elsewhere is loaded, framed or guessed.
void add_security_headers(httplib::Response& response);

/// Content-Security-Policy of pages that aren't ours to trust, as a report is.
inline constexpr const char* kSandboxPolicy =
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:";

}  // namespace remesh::http

#include "core/io/text_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/io/numbers.h"

namespace remesh::io {
namespace {

bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v';
}
bool is_space(char c) {
    return is_blank(c) || c == '\n';
}
char lower(char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

bool TextReader::skip_space() {
    while (at_ != end_) {
        if (is_space(*at_)) {
            ++at_;
        } else if (comment_ != 0 && *at_ == comment_) {
            next_line();
        } else {
            return true;
        }
    }
    return false;
}

bool TextReader::skip_blanks() {
    while (at_ != end_ && is_blank(*at_)) {
        ++at_;
    }
    return at_ != end_ && *at_ != '\n' && (comment_ == 0 || *at_ != comment_);
}

bool TextReader::next_line() {
    const auto* newline = static_cast<const char*>(
        at_ == end_ ? nullptr : std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_)));
    at_ = newline == nullptr ? end_ : newline + 1;
    return at_ != end_;
}

std::string_view TextReader::word() {
    skip_space();
    const char* start = at_;
    while (at_ != end_ && !is_space(*at_)) {
        ++at_;
    }
    return {start, static_cast<std::size_t>(at_ - start)};
}

std::string_view TextReader::rest_of_line() {
    const char* start = at_;
    next_line();
    return trimmed({start, static_cast<std::size_t>(at_ - start)});
}

bool TextReader::accept(std::string_view expected) {
    if (!skip_space()) {
        return false;
    }
    const std::string_view rest = remaining();
    if (rest.size() < expected.size() || !same_word(rest.substr(0, expected.size()), expected) ||
        (rest.size() > expected.size() && !is_space(rest[expected.size()]))) {
        return false;
    }
    at_ += expected.size();
    return true;
}

double TextReader::number() {
    skip_space();
    const char* start = at_ != end_ && *at_ == '+' ? at_ + 1 : at_;
    double value = 0.0;
    const auto result = std::from_chars(start, end_, value);
    if (result.ec == std::errc{} && (result.ptr == end_ || is_space(*result.ptr))) {
        at_ = result.ptr;
        return value;
    }
    if (!slow_number(value)) {
        fail_number();
    }
    return value;
}

// Numbers that from_chars refuses although their meaning is clear: out of range, and what
// Microsoft's library printed for NaN and infinity ("-1.#IND", "1.#QNAN", "1.#INF").
bool TextReader::slow_number(double& value) {
    TextReader ahead = *this;
    const std::string text = lower_case(ahead.word());
    const double sign = text.starts_with('-') ? -1.0 : 1.0;
    if (text.find(".#inf") != std::string::npos) {
        value = sign * std::numeric_limits<double>::infinity();
    } else if (text.find(".#") != std::string::npos) {
        value = std::numeric_limits<double>::quiet_NaN();
    } else {
        const char* start = text.data() + (text.starts_with('+') ? 1 : 0);
        const auto result = std::from_chars(start, text.data() + text.size(), value);
        if (result.ec != std::errc::result_out_of_range ||
            result.ptr != text.data() + text.size()) {
            return false;
        }
        const bool is_tiny = text.find("e-") != std::string::npos || text.find("0.") < 2;
        value = sign * (is_tiny ? 0.0 : std::numeric_limits<double>::infinity());
    }
    at_ = ahead.at_;
    return true;
}

void TextReader::fail_number() const {
    TextReader ahead = *this;
    const std::string_view text = ahead.word();
    if (text.empty()) {
        fail("the file ends where a number should be");
    }
    const std::size_t comma = text.find(',');
    if (comma != std::string_view::npos &&
        text.find_first_not_of("+-0123456789,eE") == std::string_view::npos) {
        fail(quoted(text) + " has a decimal comma; numbers need a decimal point");
    }
    fail(quoted(text) + " isn't a number");
}

std::int64_t TextReader::integer() {
    skip_space();
    const char* start = at_ != end_ && *at_ == '+' ? at_ + 1 : at_;
    std::int64_t value = 0;
    const auto result = std::from_chars(start, end_, value);
    if (result.ec == std::errc{} && (result.ptr == end_ || is_space(*result.ptr))) {
        at_ = result.ptr;
        return value;
    }
    TextReader ahead = *this;
    const std::string_view text = ahead.word();
    if (text.empty()) {
        fail("the file ends where a whole number should be");
    }
    fail(quoted(text) + " isn't a whole number" +
         (result.ec == std::errc::result_out_of_range ? " below 2^63" : ""));
}

std::int64_t TextReader::count(std::string_view what) {
    const std::int64_t value = integer();
    if (value < 0) {
        fail("the " + std::string(what) + " is negative: " + grouped(value));
    }
    return value;
}

void TextReader::fail(const std::string& message) const {
    const auto line = 1 + std::count(begin_, at_, '\n');
    throw Error(ErrorCode::InvalidInput,
                format_ + ", line " + grouped(std::int64_t{line}) + ": " + message);
}

bool same_word(std::string_view a, std::string_view b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](char x, char y) { return lower(x) == lower(y); });
}

std::string lower_case(std::string_view text) {
    std::string out(text);
    std::transform(out.begin(), out.end(), out.begin(), lower);
    return out;
}

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && is_space(text.front())) {
        text.remove_prefix(1);
    }
    while (!text.empty() && is_space(text.back())) {
        text.remove_suffix(1);
    }
    return text;
}

std::string quoted(std::string_view text, std::size_t length) {
    std::string out(text.substr(0, length));
    std::replace_if(
        out.begin(), out.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    return "'" + out + (text.size() > length ? "...'" : "'");
}

}  // namespace remesh::io

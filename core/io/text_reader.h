#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace remesh::io {

/// Walks over the words, numbers and lines of a text. Errors name the format and the line.
class TextReader {
public:
    /// \param comment  starts a comment that ends with its line; 0: the format has none
    TextReader(std::string_view text, std::string_view format, char comment = 0)
        : begin_(text.data()),
          at_(text.data()),
          end_(text.data() + text.size()),
          format_(format),
          comment_(comment) {}

    /// Skips white space, line ends and comments; false if nothing follows.
    bool skip_space();
    /// Skips blanks and a comment within the line; false if the line ends here.
    bool skip_blanks();
    /// Goes to the start of the next line; false if there's none.
    bool next_line();

    /// The next word on this or a later line; empty at the end.
    std::string_view word();
    /// What's left of the line without blanks around it; goes to the start of the next line.
    std::string_view rest_of_line();
    /// If the next word is `expected` in any case, goes past it.
    bool accept(std::string_view expected);

    /// The next number, which may be inf or nan. \throws Error{InvalidInput} if it isn't one
    double number();
    std::int64_t integer();
    /// A whole number that isn't negative. \param what  names it, e.g. "number of vertices"
    std::int64_t count(std::string_view what);

    /// What follows the present position. `skip` goes over some of its bytes.
    [[nodiscard]] std::string_view remaining() const {
        return {at_, static_cast<std::size_t>(end_ - at_)};
    }
    void skip(std::size_t bytes) { at_ += bytes; }

    /// \throws Error{InvalidInput} "FORMAT, line N: message"
    [[noreturn]] void fail(const std::string& message) const;

private:
    [[noreturn]] void fail_number() const;
    bool slow_number(double& value);

    const char* begin_;
    const char* at_;
    const char* end_;
    std::string format_;
    char comment_;
};

/// Whether two words are the same but for the case of ASCII letters.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b);
[[nodiscard]] std::string lower_case(std::string_view text);
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// At most `length` characters in quotes, with what isn't printable as '?', for error messages.
[[nodiscard]] std::string quoted(std::string_view text, std::size_t length = 40);

}  // namespace remesh::io

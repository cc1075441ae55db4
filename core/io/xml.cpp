#include "core/io/xml.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/text_reader.h"

namespace remesh::io {

void parse_xml(std::string_view text, const std::string& format, pugi::xml_document& document) {
    // An element of 4 bytes or an attribute of 5 takes some 60 bytes of memory once parsed; meshes
    // have some hundred of them.
    constexpr std::int64_t kMostNodes = 200'000;
    for (const char sign : {'<', '='}) {
        if (std::count(text.begin(), text.end(), sign) > kMostNodes) {
            throw Error(ErrorCode::TooLarge,
                        format + ": more than " + grouped(kMostNodes) + " elements or attributes");
        }
    }
    const auto parsed = document.load_buffer(
        text.data(), text.size(), pugi::parse_cdata | pugi::parse_escapes, pugi::encoding_utf8);
    if (!parsed) {
        throw Error(ErrorCode::InvalidInput,
                    format + ": not well-formed XML: " + parsed.description() + " at byte " +
                        grouped(std::int64_t{parsed.offset}));
    }
}

std::int64_t count_attribute(const pugi::xml_node& node, const char* name,
                             const std::string& format, std::int64_t missing) {
    const auto attribute = node.attribute(name);
    if (!attribute) {
        return missing;
    }
    const std::string_view text = trimmed(attribute.value());
    std::int64_t value = 0;
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    if (result.ec != std::errc{} || result.ptr != text.data() + text.size() || value < 0) {
        throw Error(ErrorCode::InvalidInput, format + ": " + name + " of <" +
                                                 std::string(node.name()).substr(0, 40) + "> is " +
                                                 quoted(text) + ", not a count");
    }
    return value;
}

}  // namespace remesh::io

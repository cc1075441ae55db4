#pragma once

#include <cstdint>
#include <pugixml.hpp>
#include <string>
#include <string_view>

namespace remesh::io {

/// Parses XML without entities, external files or document types.
/// \throws Error{InvalidInput} if it isn't well-formed, Error{TooLarge} for too many elements
void parse_xml(std::string_view text, const std::string& format, pugi::xml_document& document);

/// An attribute that is a whole number, or `missing` if it isn't there.
/// \throws Error{InvalidInput} if it isn't a number or is negative
[[nodiscard]] std::int64_t count_attribute(const pugi::xml_node& node, const char* name,
                                           const std::string& format, std::int64_t missing);

}  // namespace remesh::io

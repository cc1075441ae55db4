#pragma once

#include <cstdint>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/inflate.h"
#include "core/io/numbers.h"

namespace remesh::io {

/// Decodes the arrays of a VTK XML file, in whichever of its encodings: text, base64 in place or
/// appended, raw appended; each plain or compressed with zlib, with headers of 32 or 64 bits.
class VtkXmlArrays {
public:
    /// \param appended  what follows '_' in <AppendedData>, or empty
    VtkXmlArrays(const pugi::xml_node& root, std::string_view appended, bool appended_is_base64,
                 InflateBudget& budget);

    /// All values of a DataArray.
    /// \throws Error{InvalidInput} if it's damaged or ends early
    /// \throws Error{Unsupported} for a compressor other than zlib
    [[nodiscard]] std::vector<double> reals(const pugi::xml_node& array);
    [[nodiscard]] std::vector<std::int64_t> integers(const pugi::xml_node& array);

private:
    [[nodiscard]] std::string bytes_of(const pugi::xml_node& array);
    [[nodiscard]] std::uint64_t header_word(std::string_view header, std::size_t i) const;
    template <typename Source>
    [[nodiscard]] std::string decode(Source source, const std::string& what);
    template <typename Source>
    [[nodiscard]] std::string decode_compressed(Source& source, const std::string& what);

    std::string_view appended_;
    bool appended_is_base64_;
    InflateBudget& budget_;
    bool swap_ = false;
    std::string compressor_{};
    NumberType header_type_ = NumberType::UInt32;
};

/// The type of a DataArray. \throws Error{InvalidInput} for one that VTK doesn't have
[[nodiscard]] NumberType vtk_xml_type(const pugi::xml_node& array);

}  // namespace remesh::io

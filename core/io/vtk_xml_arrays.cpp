#include "core/io/vtk_xml_arrays.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/error.h"
#include "core/io/base64.h"
#include "core/io/text_reader.h"
#include "core/io/xml.h"

namespace remesh::io {
namespace {

std::string name_of(const pugi::xml_node& array) {
    return "VTP: array " + quoted(array.attribute("Name").value());
}

[[noreturn]] void fail_short(const std::string& what) {
    throw Error(ErrorCode::InvalidInput, what + " ends early");
}

// The two ways in which binary data stands in a file; first(n) gives its first n bytes.
class RawSource {
public:
    RawSource(std::string_view bytes, std::string what) : bytes_(bytes), what_(std::move(what)) {}

    std::string first(std::uint64_t size) const {
        if (size > bytes_.size()) {
            fail_short(what_);
        }
        return std::string(bytes_.substr(0, static_cast<std::size_t>(size)));
    }
    [[nodiscard]] std::uint64_t most() const { return bytes_.size(); }

private:
    std::string_view bytes_;
    std::string what_;
};

class Base64Source {
public:
    Base64Source(std::string_view text, std::string what) : text_(text), what_(std::move(what)) {}

    std::string first(std::uint64_t size) const {
        std::string bytes = decode_base64(text_, static_cast<std::size_t>(size));
        if (bytes.size() < size) {
            fail_short(what_);
        }
        return bytes;
    }
    [[nodiscard]] std::uint64_t most() const { return text_.size(); }

private:
    std::string_view text_;
    std::string what_;
};

}  // namespace

NumberType vtk_xml_type(const pugi::xml_node& array) {
    constexpr std::array<std::pair<std::string_view, NumberType>, 11> kTypes{
        {{"Int8", NumberType::Int8},
         {"UInt8", NumberType::UInt8},
         {"Int16", NumberType::Int16},
         {"UInt16", NumberType::UInt16},
         {"Int32", NumberType::Int32},
         {"UInt32", NumberType::UInt32},
         {"Int64", NumberType::Int64},
         {"UInt64", NumberType::UInt64},
         {"Float32", NumberType::Float32},
         {"Float64", NumberType::Float64},
         {"String", NumberType::UInt8}}};  // Characters, each string with a 0 after it.
    const std::string_view name = array.attribute("type").value();
    for (const auto& [known, type] : kTypes) {
        if (name == known) {
            return type;
        }
    }
    throw Error(ErrorCode::InvalidInput, name_of(array) + " has the unknown type " + quoted(name));
}

VtkXmlArrays::VtkXmlArrays(const pugi::xml_node& root, std::string_view appended,
                           bool appended_is_base64, InflateBudget& budget)
    : appended_(appended), appended_is_base64_(appended_is_base64), budget_(budget) {
    swap_ = must_swap(std::string_view(root.attribute("byte_order").value()) == "BigEndian"
                          ? std::endian::big
                          : std::endian::little);
    if (std::string_view(root.attribute("header_type").value()) == "UInt64") {
        header_type_ = NumberType::UInt64;
    }
    compressor_ = root.attribute("compressor").value();
}

std::vector<double> VtkXmlArrays::reals(const pugi::xml_node& array) {
    if (std::string_view(array.attribute("format").value()) != "ascii") {
        return to_doubles(bytes_of(array), vtk_xml_type(array), swap_);
    }
    std::vector<double> values;
    for (TextReader text(array.child_value(), name_of(array)); text.skip_space();) {
        values.push_back(text.number());
    }
    return values;
}

std::vector<std::int64_t> VtkXmlArrays::integers(const pugi::xml_node& array) {
    if (std::string_view(array.attribute("format").value()) != "ascii") {
        return to_integers(bytes_of(array), vtk_xml_type(array), swap_);
    }
    std::vector<std::int64_t> values;
    for (TextReader text(array.child_value(), name_of(array)); text.skip_space();) {
        values.push_back(text.integer());
    }
    return values;
}

std::string VtkXmlArrays::bytes_of(const pugi::xml_node& array) {
    const std::string what = name_of(array);
    const std::string_view format = array.attribute("format").value();
    if (format == "binary") {
        return decode(Base64Source(array.child_value(), what), what);
    }
    if (format != "appended") {
        throw Error(ErrorCode::InvalidInput, what + " has the unknown format " + quoted(format));
    }
    const auto offset = static_cast<std::uint64_t>(count_attribute(array, "offset", what, 0));
    if (offset >= appended_.size()) {
        throw Error(ErrorCode::InvalidInput,
                    what + " begins beyond the end of the file's appended data");
    }
    const std::string_view data = appended_.substr(static_cast<std::size_t>(offset));
    return appended_is_base64_ ? decode(Base64Source(data, what), what)
                               : decode(RawSource(data, what), what);
}

std::uint64_t VtkXmlArrays::header_word(std::string_view header, std::size_t i) const {
    const char* at = header.data() + i * size_of(header_type_);
    return header_type_ == NumberType::UInt64 ? load<std::uint64_t>(at, swap_)
                                              : std::uint64_t{load<std::uint32_t>(at, swap_)};
}

// Plain: a word with the number of bytes, then the bytes.
template <typename Source>
std::string VtkXmlArrays::decode(Source source, const std::string& what) {
    if (compressor_ == "vtkZLibDataCompressor") {
        return decode_compressed(source, what);
    }
    if (!compressor_.empty()) {
        throw Error(ErrorCode::Unsupported, what + " is compressed by " + quoted(compressor_) +
                                                "; only zlib and no compression are read");
    }
    const std::size_t word = size_of(header_type_);
    const std::uint64_t size = header_word(source.first(word), 0);
    if (size > source.most()) {
        fail_short(what);
    }
    budget_.charge(size);  // Any number of arrays may lie in the same appended bytes.
    std::string bytes = source.first(word + size);
    bytes.erase(0, word);
    return bytes;
}

// Compressed: words with the number of blocks, the size of a block and of the last one (0 if it's
// whole), then the compressed size of each block; then the blocks.
template <typename Source>
std::string VtkXmlArrays::decode_compressed(Source& source, const std::string& what) {
    const std::size_t word = size_of(header_type_);
    std::string header = source.first(3 * word);
    const std::uint64_t blocks = header_word(header, 0);
    const std::uint64_t block_size = header_word(header, 1);
    const std::uint64_t last_size = header_word(header, 2);
    if (blocks > source.most() / word) {
        fail_short(what);
    }
    header = source.first((3 + blocks) * word);
    std::uint64_t total = header.size();
    for (std::size_t i = 0; i < blocks; ++i) {
        const std::uint64_t size = header_word(header, 3 + i);
        if (size > source.most() - std::min(source.most(), total)) {
            fail_short(what);
        }
        total += size;
    }

    const std::string data = source.first(total);
    std::string_view rest = std::string_view(data).substr(header.size());
    std::string out;
    for (std::size_t i = 0; i < blocks; ++i) {
        const auto compressed = static_cast<std::size_t>(header_word(header, 3 + i));
        const bool is_partial = i + 1 == blocks && last_size != 0;
        inflate_block(rest.substr(0, compressed), is_partial ? last_size : block_size, budget_,
                      what, out);
        rest.remove_prefix(compressed);
    }
    return out;
}

}  // namespace remesh::io

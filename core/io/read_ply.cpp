#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

struct Property {
    std::string name{};
    NumberType type = NumberType::Float32;   ///< Of the value, or of a list's items.
    std::optional<NumberType> count_type{};  ///< For a list.
};

struct Element {
    std::string name{};
    std::int64_t count = 0;
    std::vector<Property> properties{};
};

enum class Encoding { Ascii, LittleEndian, BigEndian };

struct Header {
    Encoding encoding = Encoding::Ascii;
    std::vector<Element> elements{};
    std::vector<std::string> patch_names{};
    std::string_view data{};
};

NumberType number_type(std::string_view name, const TextReader& text) {
    constexpr std::array<std::pair<std::string_view, NumberType>, 16> kTypes{
        {{"char", NumberType::Int8},
         {"int8", NumberType::Int8},
         {"uchar", NumberType::UInt8},
         {"uint8", NumberType::UInt8},
         {"short", NumberType::Int16},
         {"int16", NumberType::Int16},
         {"ushort", NumberType::UInt16},
         {"uint16", NumberType::UInt16},
         {"int", NumberType::Int32},
         {"int32", NumberType::Int32},
         {"uint", NumberType::UInt32},
         {"uint32", NumberType::UInt32},
         {"float", NumberType::Float32},
         {"float32", NumberType::Float32},
         {"double", NumberType::Float64},
         {"float64", NumberType::Float64}}};
    for (const auto& [known, type] : kTypes) {
        if (name == known) {
            return type;
        }
    }
    text.fail(quoted(name) + " isn't a type of PLY");
}

class HeaderReader {
public:
    explicit HeaderReader(std::string_view bytes) : bytes_(bytes), text_(bytes, "PLY") {}

    Header read() {
        check_end();
        text_.rest_of_line();
        while (true) {
            const std::string_view keyword = text_.word();
            if (keyword == "end_header") {
                text_.next_line();
                header_.data = text_.remaining();
                return std::move(header_);
            }
            if (keyword == "format") {
                read_format();
            } else if (keyword == "element") {
                read_element();
            } else if (keyword == "property") {
                read_property();
            } else if (keyword == "comment") {
                read_comment();
            } else if (keyword == "obj_info") {
                text_.next_line();
            } else {
                text_.fail(quoted(keyword) + " doesn't belong in a PLY header");
            }
        }
    }

private:
    void check_end() const {
        constexpr std::size_t kLongest = std::size_t{1} << 20;
        if (bytes_.substr(0, kLongest).find("\nend_header") == std::string_view::npos) {
            throw Error(ErrorCode::InvalidInput,
                        "PLY: the header has no end_header within the first " +
                            grouped(std::min(kLongest, bytes_.size())) + " bytes");
        }
    }

    void read_format() {
        const std::string_view name = text_.word();
        if (name == "ascii") {
            header_.encoding = Encoding::Ascii;
        } else if (name == "binary_little_endian") {
            header_.encoding = Encoding::LittleEndian;
        } else if (name == "binary_big_endian") {
            header_.encoding = Encoding::BigEndian;
        } else {
            text_.fail(quoted(name) + " isn't a format of PLY");
        }
        text_.word();
    }

    void read_element() {
        Element element;
        element.name = text_.word();
        element.count = text_.count("number of " + element.name);
        header_.elements.push_back(std::move(element));
    }

    void read_property() {
        if (header_.elements.empty()) {
            text_.fail("a property stands before the first element");
        }
        Property property;
        std::string_view type = text_.word();
        if (type == "list") {
            property.count_type = number_type(text_.word(), text_);
            if (!is_integer(*property.count_type)) {
                text_.fail("the length of a list can't be a floating-point number");
            }
            type = text_.word();
        }
        property.type = number_type(type, text_);
        property.name = text_.word();
        header_.elements.back().properties.push_back(std::move(property));
    }

    // Our own files name patch i in the i-th line "comment patch NAME".
    void read_comment() {
        const std::string_view comment = text_.skip_blanks() ? text_.rest_of_line() : "";
        constexpr std::string_view kPatch = "patch ";
        if (comment.starts_with(kPatch)) {
            header_.patch_names.emplace_back(comment.substr(kPatch.size()));
        }
    }

    std::string_view bytes_;
    TextReader text_;
    Header header_{};
};

// Where the values of the body come from. The two kinds have the same functions.
class AsciiValues {
public:
    // Starts at the header, so that errors name the right line.
    AsciiValues(std::string_view bytes, std::size_t data) : text_(bytes, "PLY") {
        text_.skip(data);
    }

    double real(NumberType) { return text_.number(); }
    std::int64_t integer(NumberType) { return text_.integer(); }
    void skip(NumberType) {
        if (text_.word().empty()) {
            text_.fail("the file ends inside its data");
        }
    }
    bool has(std::int64_t values, NumberType) {
        return values <= static_cast<std::int64_t>(text_.remaining().size() / 2 + 1) &&
               (values == 0 || text_.skip_space());
    }
    [[nodiscard]] static std::size_t smallest(NumberType) { return 2; }
    [[nodiscard]] std::size_t bytes_left() const { return text_.remaining().size() + 1; }

private:
    TextReader text_;
};

class BinaryValues {
public:
    BinaryValues(std::string_view data, bool swap) : data_(data), swap_(swap) {}

    double real(NumberType type) { return load_double(take(type), type, swap_); }
    std::int64_t integer(NumberType type) { return load_integer(take(type), type, swap_); }
    void skip(NumberType type) { take(type); }
    [[nodiscard]] bool has(std::int64_t values, NumberType type) const {
        return values <= static_cast<std::int64_t>(bytes_left() / size_of(type));
    }
    [[nodiscard]] static std::size_t smallest(NumberType type) { return size_of(type); }
    [[nodiscard]] std::size_t bytes_left() const { return data_.size(); }

private:
    const char* take(NumberType type) {
        const std::size_t size = size_of(type);
        if (data_.size() < size) {
            throw Error(ErrorCode::InvalidInput, "PLY: the file ends inside its data");
        }
        const char* at = data_.data();
        data_.remove_prefix(size);
        return at;
    }

    std::string_view data_;
    bool swap_;
};

template <typename Values>
class BodyReader {
public:
    BodyReader(Header header, Values values, const ReadLimits& limits, std::string_view size_field)
        : header_(std::move(header)),
          values_(std::move(values)),
          size_field_(size_field),
          builder_(MeshFormat::Ply, "PLY", limits) {}

    ReadResult read() {
        for (const auto& element : header_.elements) {
            check_size(element);
            if (element.name == "vertex") {
                read_vertices(element);
            } else if (element.name == "face") {
                read_faces(element);
            } else {
                for (std::int64_t i = 0; !element.properties.empty() && i < element.count; ++i) {
                    for (const auto& property : element.properties) {
                        skip(property);
                    }
                }
            }
        }
        builder_.name_patches(header_.patch_names);
        if (!size_field_.empty()) {
            builder_.set_sizes(std::move(sizes_), size_field_);
        }
        return builder_.finish();
    }

private:
    // So that a false count is told at once, and isn't believed when memory is set aside.
    void check_size(const Element& element) const {
        std::size_t least = 0;
        for (const auto& property : element.properties) {
            least += Values::smallest(property.count_type.value_or(property.type));
        }
        if (least > 0 && element.count > static_cast<std::int64_t>(values_.bytes_left() / least)) {
            throw Error(ErrorCode::InvalidInput, "PLY says " + grouped(element.count) + " of " +
                                                     quoted(element.name) + " but only " +
                                                     grouped(values_.bytes_left()) +
                                                     " bytes are left for them");
        }
    }

    void read_vertices(const Element& element) {
        const auto& properties = element.properties;
        std::array<std::size_t, 3> where{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::string name(1, "xyz"[axis]);
            const auto found =
                std::find_if(properties.begin(), properties.end(),
                             [&](const Property& p) { return p.name == name && !p.count_type; });
            if (found == properties.end()) {
                throw Error(ErrorCode::InvalidInput, "PLY: vertices have no property " + name);
            }
            where[axis] = static_cast<std::size_t>(found - properties.begin());
        }
        builder_.reserve(element.count, 0);
        for (std::int64_t i = 0; i < element.count; ++i) {
            Vec3 position;
            for (std::size_t p = 0; p < properties.size(); ++p) {
                const auto axis = std::find(where.begin(), where.end(), p) - where.begin();
                if (axis < 3) {
                    position[axis] = values_.real(properties[p].type);
                } else if (is_size(properties[p])) {
                    sizes_.push_back(values_.real(properties[p].type));
                } else {
                    skip(properties[p]);
                }
            }
            builder_.add_vertex(position);
        }
    }

    [[nodiscard]] bool is_size(const Property& property) const {
        return !size_field_.empty() && property.name == size_field_ && !property.count_type;
    }

    void read_faces(const Element& element) {
        const auto is_corners = [](const Property& p) {
            return p.count_type && (p.name == "vertex_indices" || p.name == "vertex_index");
        };
        if (std::none_of(element.properties.begin(), element.properties.end(), is_corners)) {
            throw Error(ErrorCode::InvalidInput, "PLY: faces have no list property vertex_indices");
        }
        builder_.reserve(0, element.count);
        for (face_ = 1; face_ <= element.count; ++face_) {
            for (const auto& property : element.properties) {
                if (is_corners(property)) {
                    read_list(property, corners_);
                } else if (property.name == "patch" && !property.count_type) {
                    begin_patch(values_.integer(property.type));
                } else {
                    skip(property);
                }
            }
            builder_.add_face(corners_);
        }
    }

    void begin_patch(std::int64_t id) {
        if (id != static_cast<std::int32_t>(id)) {
            throw Error(ErrorCode::InvalidInput, "PLY: face " + grouped(face_) + " is in patch " +
                                                     grouped(id) + ", beyond 32 bits");
        }
        builder_.begin_patch(static_cast<std::int32_t>(id));
    }

    std::int64_t list_length(const Property& property) {
        const std::int64_t length = values_.integer(*property.count_type);
        if (length < 0 || !values_.has(length, property.type)) {
            throw Error(ErrorCode::InvalidInput,
                        "PLY: a list says that it has " + grouped(length) + " items" +
                            (length < 0 ? "" : ", more than the file holds") +
                            (face_ > 0 ? " (face " + grouped(face_) + ")" : ""));
        }
        return length;
    }

    void read_list(const Property& property, std::vector<std::int64_t>& items) {
        items.resize(static_cast<std::size_t>(list_length(property)));
        for (auto& item : items) {
            item = values_.integer(property.type);
        }
    }

    void skip(const Property& property) {
        const std::int64_t length = property.count_type ? list_length(property) : 1;
        for (std::int64_t i = 0; i < length; ++i) {
            values_.skip(property.type);
        }
    }

    Header header_;
    Values values_;
    std::string_view size_field_;
    SurfaceBuilder builder_;
    std::vector<double> sizes_{};
    std::vector<std::int64_t> corners_{};
    std::int64_t face_ = 0;  // Counted from 1; 0 before the faces.
};

}  // namespace

ReadResult read_ply(std::string_view bytes, const ReadLimits& limits, std::string_view size_field) {
    Header header = HeaderReader(bytes).read();
    const std::string_view data = header.data;
    if (header.encoding == Encoding::Ascii) {
        return BodyReader(std::move(header), AsciiValues(bytes, bytes.size() - data.size()), limits,
                          size_field)
            .read();
    }
    const std::endian order =
        header.encoding == Encoding::LittleEndian ? std::endian::little : std::endian::big;
    return BodyReader(std::move(header), BinaryValues(data, must_swap(order)), limits, size_field)
        .read();
}

}  // namespace remesh::io

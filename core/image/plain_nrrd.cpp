#include <array>
#include <map>
#include <utility>

#include "core/error.h"
#include "core/image/plain_image.h"
#include "core/io/text_reader.h"

namespace remesh::image {
namespace {

struct Type {
    std::string_view name;
    std::string_view canonical;
    std::uint64_t bytes;
};

constexpr std::array<Type, 38> kTypes{{
    {"signed char", "int8", 1},
    {"int8", "int8", 1},
    {"int8_t", "int8", 1},
    {"uchar", "uint8", 1},
    {"unsigned char", "uint8", 1},
    {"uint8", "uint8", 1},
    {"uint8_t", "uint8", 1},
    {"short", "int16", 2},
    {"short int", "int16", 2},
    {"signed short", "int16", 2},
    {"signed short int", "int16", 2},
    {"int16", "int16", 2},
    {"int16_t", "int16", 2},
    {"ushort", "uint16", 2},
    {"unsigned short", "uint16", 2},
    {"unsigned short int", "uint16", 2},
    {"uint16", "uint16", 2},
    {"uint16_t", "uint16", 2},
    {"int", "int32", 4},
    {"signed int", "int32", 4},
    {"int32", "int32", 4},
    {"int32_t", "int32", 4},
    {"uint", "uint32", 4},
    {"unsigned int", "uint32", 4},
    {"uint32", "uint32", 4},
    {"uint32_t", "uint32", 4},
    {"longlong", "int64", 8},
    {"long long", "int64", 8},
    {"long long int", "int64", 8},
    {"int64", "int64", 8},
    {"int64_t", "int64", 8},
    {"ulonglong", "uint64", 8},
    {"unsigned long long", "uint64", 8},
    {"unsigned long long int", "uint64", 8},
    {"uint64", "uint64", 8},
    {"uint64_t", "uint64", 8},
    {"float", "float", 4},
    {"double", "double", 8},
}};

const Type& type_of(const std::string& name) {
    for (const Type& type : kTypes) {
        if (type.name == name) {
            return type;
        }
    }
    throw Error(ErrorCode::Unsupported,
                "NRRD: voxels must be single numbers, got type " + io::quoted(name));
}

/// Fields that say what the voxels are and where; all others are left out.
class Fields {
public:
    void add(std::string_view line) {
        const std::size_t colon = line.find(": ");
        if (line.starts_with('#') || line.find(":=") != std::string_view::npos) {
            return;  // A comment, or a pair of the user's own.
        }
        if (colon == std::string_view::npos) {
            throw Error(ErrorCode::InvalidInput, "NRRD: no field of a header: " + io::quoted(line));
        }
        fields_[io::lower_case(line.substr(0, colon))] = io::trimmed(line.substr(colon + 2));
    }
    [[nodiscard]] bool has(const std::string& name) const { return fields_.contains(name); }
    [[nodiscard]] std::string at(const std::string& name) const {
        const auto found = fields_.find(name);
        if (found == fields_.end()) {
            throw Error(ErrorCode::InvalidInput, "NRRD: the header has no field '" + name + "'");
        }
        return found->second;
    }
    void refuse(const std::string& name, const std::string& why) const {
        const auto found = fields_.find(name);
        if (found != fields_.end() && found->second != "0") {
            throw Error(ErrorCode::Unsupported, "NRRD: '" + name + "' " + why);
        }
    }

    void require_millimetres() const {
        const auto found = fields_.find("space units");
        if (found == fields_.end()) {
            return;
        }
        io::TextReader reader(found->second, "NRRD: space units");
        for (auto unit = reader.word(); !unit.empty(); unit = reader.word()) {
            if (unit != "\"mm\"" && unit != "\"millimeter\"" && unit != "\"\"") {
                throw Error(ErrorCode::Unsupported,
                            "NRRD: space units must be mm, got " + io::quoted(found->second));
            }
        }
    }

private:
    std::map<std::string, std::string> fields_{};
};

/// Whether the voxels are compressed.
bool is_gzip_encoded(const Fields& fields) {
    const std::string encoding = io::lower_case(fields.at("encoding"));
    if (encoding != "raw" && encoding != "gzip" && encoding != "gz") {
        throw Error(ErrorCode::Unsupported,
                    "NRRD: the encoding must be raw or gzip, got " + io::quoted(encoding));
    }
    return encoding != "raw";
}

}  // namespace

PlainImage plain_nrrd(std::string_view bytes, const ImageLimits& limits) {
    Fields fields;
    bool is_first = true;
    const std::string_view rest = for_each_line(bytes, "NRRD", [&](std::string_view line) {
        if (!line.empty() && !std::exchange(is_first, false)) {
            fields.add(line);
        }
        return !line.empty();
    });
    for (const char* name : {"data file", "datafile"}) {
        fields.refuse(name, "names another file; save header and voxels in one .nrrd");
    }
    for (const char* name : {"axis mins", "axismins", "axis maxs", "axismaxs"}) {
        fields.refuse(name, "isn't read; save the image with 'space origin'");
    }
    fields.require_millimetres();
    for (const char* name : {"byte skip", "byteskip", "line skip", "lineskip"}) {
        fields.refuse(name, "isn't read");
    }
    if (fields.at("dimension") != "3") {
        throw Error(ErrorCode::Unsupported, "NRRD: a size image has three dimensions, got " +
                                                io::quoted(fields.at("dimension")));
    }
    PlainImage plain;
    plain.format = ImageFormat::Nrrd;
    plain.size = three_counts(fields.at("sizes"), "NRRD: sizes");
    const Type& type = type_of(io::lower_case(fields.at("type")));
    const std::uint64_t size = checked_bytes(plain, type.bytes, "NRRD", limits);
    take_voxels(plain, rest, is_gzip_encoded(fields), size, "NRRD", bytes.size());

    plain.header = "NRRD0005\ntype: " + std::string(type.canonical) +
                   "\ndimension: 3\nencoding: raw\nendian: " +
                   (type.bytes > 1 ? io::lower_case(fields.at("endian")) : "little") + '\n';
    // The order matters: what depends on the space comes after it.
    for (const char* name :
         {"space", "space dimension", "sizes", "space directions", "space origin", "spacings"}) {
        if (fields.has(name)) {
            plain.header += std::string(name) + ": " + fields.at(name) + '\n';
        }
    }
    plain.header += '\n';
    return plain;
}

}  // namespace remesh::image

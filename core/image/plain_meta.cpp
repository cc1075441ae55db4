#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "core/error.h"
#include "core/image/plain_image.h"
#include "core/io/text_reader.h"

namespace remesh::image {
namespace {

// MET_LONG isn't here: it has 4 bytes in some files and 8 in others.
constexpr std::array<std::pair<std::string_view, std::uint64_t>, 10> kTypes{{
    {"MET_CHAR", 1},
    {"MET_UCHAR", 1},
    {"MET_SHORT", 2},
    {"MET_USHORT", 2},
    {"MET_INT", 4},
    {"MET_UINT", 4},
    {"MET_LONG_LONG", 8},
    {"MET_ULONG_LONG", 8},
    {"MET_FLOAT", 4},
    {"MET_DOUBLE", 8},
}};

using Fields = std::map<std::string, std::string, std::less<>>;

std::string field(const Fields& fields, std::string_view name, const std::string& otherwise = {}) {
    const auto found = fields.find(name);
    return found == fields.end() ? otherwise : found->second;
}

bool is_true(const std::string& word) {
    return io::same_word(word, "true") || word == "1";
}

void require(const Fields& fields, std::string_view name, const std::string& value,
             const std::string& why) {
    if (const std::string got = field(fields, name, value); !io::same_word(got, value)) {
        throw Error(ErrorCode::Unsupported, "MetaImage: " + std::string(name) + " must be " +
                                                value + why + ", got " + io::quoted(got));
    }
}

std::uint64_t bytes_of_type(const std::string& type) {
    const auto* found = std::find_if(kTypes.begin(), kTypes.end(),
                                     [&](const auto& pair) { return pair.first == type; });
    if (found == kTypes.end()) {
        throw Error(ErrorCode::Unsupported,
                    "MetaImage: ElementType isn't one that is read: " + io::quoted(type));
    }
    return found->second;
}

}  // namespace

PlainImage plain_meta(std::string_view bytes, const ImageLimits& limits) {
    Fields fields;
    const std::string_view rest = for_each_line(bytes, "MetaImage", [&](std::string_view line) {
        const std::size_t equals = line.find('=');
        if (equals == std::string_view::npos) {
            throw Error(ErrorCode::InvalidInput,
                        "MetaImage: no field of a header: " + io::quoted(line));
        }
        const std::string name(io::trimmed(line.substr(0, equals)));
        fields[name] = io::trimmed(line.substr(equals + 1));
        return name != "ElementDataFile";
    });
    require(fields, "ElementDataFile", "LOCAL", "; save header and voxels in one .mha");
    require(fields, "ObjectType", "Image", "");
    require(fields, "NDims", "3", "");
    require(fields, "BinaryData", "True", "");
    require(fields, "HeaderSize", "0", "");
    require(fields, "ElementNumberOfChannels", "1", "");
    if (field(fields, "DistanceUnits") != "?") {
        require(fields, "DistanceUnits", "mm", "");
    }
    PlainImage plain;
    plain.format = ImageFormat::MetaImage;
    plain.size = three_counts(field(fields, "DimSize"), "MetaImage: DimSize");
    const std::string type = field(fields, "ElementType");
    const std::uint64_t size = checked_bytes(plain, bytes_of_type(type), "MetaImage", limits);
    take_voxels(plain, rest, is_true(field(fields, "CompressedData")), size, "MetaImage",
                bytes.size());

    plain.header = "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = False\n";
    for (const char* name : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB", "TransformMatrix",
                             "Rotation", "Orientation", "Offset", "Origin", "Position",
                             "ElementSpacing", "ElementSize", "DimSize"}) {
        if (fields.contains(name)) {
            plain.header += std::string(name) + " = " + fields.at(name) + '\n';
        }
    }
    plain.header += "ElementType = " + type + "\nElementDataFile = LOCAL\n";
    return plain;
}

}  // namespace remesh::image

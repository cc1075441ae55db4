#include "core/io/detect.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "core/io/readers.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

using namespace std::string_view_literals;

struct Signature {
    std::size_t offset;
    std::string_view bytes;
    std::string_view what;
};

constexpr std::array kLabelMaps{
    Signature{344, "n+1\0"sv, "NIfTI"},
    Signature{344, "ni1\0"sv, "NIfTI"},
    Signature{0, "\x5c\x01\0\0"sv, "NIfTI"},
    Signature{0, "\0\0\x01\x5c"sv, "NIfTI"},
    Signature{4, "n+2\0"sv, "NIfTI"},
    Signature{4, "ni2\0"sv, "NIfTI"},
    Signature{0, "NRRD000"sv, "NRRD"},
    Signature{0, "#INRIMAGE"sv, "INRIMAGE"},
    Signature{252, "\xef\xff\xe9\xb0"sv, "GIPL"},
    Signature{252, "\x2a\xe3\x89\xb8"sv, "GIPL"},
};

constexpr std::array kOthers{
    Signature{0, "PK\x03\x04"sv, "a ZIP archive: unpack it and give the surface inside"},
    Signature{0, "PK\x05\x06"sv, "an empty ZIP archive"},
    Signature{0, "7z\xbc\xaf"sv, "a 7-Zip archive: unpack it and give the surface inside"},
    Signature{0, "Rar!"sv, "a RAR archive: unpack it and give the surface inside"},
    Signature{0, "\xfd\x37zXZ"sv, "compressed by xz: only gzip is read"},
    Signature{0, "BZh"sv, "compressed by bzip2: only gzip is read"},
    Signature{0, "\x28\xb5\x2f\xfd"sv, "compressed by zstd: only gzip is read"},
    Signature{0, "\xff\xd8\xff"sv, "a JPEG picture, not a mesh"},
    Signature{0, "\x89PNG"sv, "a PNG picture, not a mesh"},
    Signature{0, "%PDF"sv, "a PDF document, not a mesh"},
    Signature{0, "\x89HDF"sv, "an HDF5 file, which isn't read"},
    Signature{0, "glTF"sv, "a binary glTF file, which isn't read; give STL, PLY, OBJ or VTP"},
    Signature{0, "ISO-10303-21"sv, "a STEP model: export its surface as STL"},
    Signature{0, "$MeshFormat"sv, "a gmsh mesh, which is written but not read; give a surface"},
    Signature{0, "MeshVersionFormatted"sv,
              "a Medit mesh, which is written but not read; give a surface"},
    Signature{128, "DICM"sv,
              "a DICOM file; label maps and segmentations are not read yet, give a surface"},
};

bool matches(std::string_view bytes, const Signature& signature) {
    return bytes.size() >= signature.offset &&
           bytes.substr(signature.offset).starts_with(signature.bytes);
}

[[noreturn]] void refuse_label_map(std::string_view kind) {
    throw Error(ErrorCode::Unsupported, "the file is a label map or image (" + std::string(kind) +
                                            "): label maps are not read yet, give a surface");
}

bool is_meta_image(std::string_view head) {
    return (head.starts_with("ObjectType") || head.starts_with("NDims") ||
            head.starts_with("Comment")) &&
           head.find("DimSize") != std::string_view::npos;
}

// [ST][C][N][4][n]OFF
bool is_off_keyword(std::string_view word) {
    return word.size() <= 8 && word.ends_with("OFF") &&
           word.substr(0, word.size() - 3).find_first_not_of("STCN4n") == std::string_view::npos;
}

bool is_obj_keyword(std::string_view word) {
    constexpr std::array kKeywords{"v"sv, "vn"sv, "vt"sv, "f"sv, "g"sv, "o"sv, "s"sv, "mtllib"sv};
    return std::find(kKeywords.begin(), kKeywords.end(), word) != kKeywords.end();
}

std::optional<MeshFormat> format_of_content(std::string_view bytes) {
    const std::string_view head = bytes.substr(0, kHead);
    if (head.starts_with("ply\n") || head.starts_with("ply\r")) {
        return MeshFormat::Ply;
    }
    if (same_word(head.substr(0, 14), "# vtk DataFile")) {
        return MeshFormat::Vtk;
    }
    const std::string_view text = trimmed(head);
    if (text.starts_with("<")) {
        if (head.find("<VTKFile") != std::string_view::npos) {
            return MeshFormat::Vtp;
        }
        if (head.find("<GIFTI") != std::string_view::npos) {
            return MeshFormat::Gifti;
        }
    }
    TextReader words(head, "", '#');
    const std::string_view word = words.word();
    if (is_off_keyword(word)) {
        return MeshFormat::Off;
    }
    if (same_word(word, "solid")) {
        return MeshFormat::Stl;
    }
    return {};
}

}  // namespace

void refuse_other_formats(std::string_view head) {
    for (const auto& signature : kLabelMaps) {
        if (matches(head, signature)) {
            refuse_label_map(signature.what);
        }
    }
    if (is_meta_image(head.substr(0, kHead))) {
        refuse_label_map("MetaImage");
    }
    for (const auto& signature : kOthers) {
        if (matches(head, signature)) {
            throw Error(ErrorCode::Unsupported, "the file is " + std::string(signature.what));
        }
    }
    const std::string start = lower_case(trimmed(head.substr(0, kHead)).substr(0, 14));
    if (start.starts_with("<html") || start.starts_with("<!doctype html")) {
        throw Error(ErrorCode::InvalidInput,
                    "the file is a web page (HTML), not a mesh: its download may have failed");
    }
}

MeshFormat detect_format(std::string_view bytes, std::string_view name_hint) {
    const auto by_name = format_of_name(name_hint);
    // A binary STL may begin with any words, so its size counts more than they.
    if (has_exact_binary_stl_size(bytes)) {
        return MeshFormat::Stl;
    }
    refuse_other_formats(bytes);
    if (const auto by_content = format_of_content(bytes)) {
        return *by_content;
    }
    if (by_name == MeshFormat::Stl || by_name == MeshFormat::Obj || by_name == MeshFormat::Off) {
        return *by_name;  // These may have no signature.
    }
    TextReader words(bytes.substr(0, kHead), "", '#');
    if (is_obj_keyword(words.word())) {
        return MeshFormat::Obj;
    }
    if (by_name && can_read(*by_name)) {
        throw Error(ErrorCode::InvalidInput, "the file is named as " +
                                                 std::string(format_name(*by_name)) +
                                                 " but doesn't begin like one");
    }
    throw Error(ErrorCode::InvalidInput,
                "the file's format isn't known: STL, PLY, OFF, OBJ, VTP, legacy VTK and GIfTI "
                "surfaces are read, gzipped or not");
}

}  // namespace remesh::io

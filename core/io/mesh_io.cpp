#include "core/io/mesh_io.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "core/io/detect.h"
#include "core/io/inflate.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/text_reader.h"
#include "core/io/writers.h"

namespace remesh {
namespace {

struct FormatFacts {
    MeshFormat format;
    std::string_view name;
    std::string_view extension;
    bool can_read;
    bool can_write_surface;
    bool can_write_tets;
};

constexpr std::array kFormats{
    FormatFacts{MeshFormat::Stl, "stl", ".stl", true, true, false},
    FormatFacts{MeshFormat::Ply, "ply", ".ply", true, true, false},
    FormatFacts{MeshFormat::Off, "off", ".off", true, true, false},
    FormatFacts{MeshFormat::Obj, "obj", ".obj", true, true, false},
    FormatFacts{MeshFormat::Vtp, "vtp", ".vtp", true, true, false},
    FormatFacts{MeshFormat::Vtk, "vtk", ".vtk", true, true, true},
    FormatFacts{MeshFormat::Gifti, "gifti", ".gii", true, false, false},
    FormatFacts{MeshFormat::Vtu, "vtu", ".vtu", false, false, true},
    FormatFacts{MeshFormat::Medit, "medit", ".mesh", false, false, true},
    FormatFacts{MeshFormat::Msh41, "msh41", ".msh", false, false, true},
    FormatFacts{MeshFormat::Msh22, "msh22", ".msh", false, false, true},
};

const FormatFacts& facts_of(MeshFormat format) {
    return *std::find_if(kFormats.begin(), kFormats.end(),
                         [&](const FormatFacts& facts) { return facts.format == format; });
}

[[noreturn]] void refuse_to_write(MeshFormat format, const std::string& what) {
    throw Error(ErrorCode::Unsupported,
                what + " can't be written as " + std::string(format_name(format)));
}

// Editors put a byte order mark before text; no format wants it.
std::string_view without_mark(std::string_view bytes) {
    constexpr std::string_view kMark = "\xef\xbb\xbf";
    return bytes.starts_with(kMark) ? bytes.substr(kMark.size()) : bytes;
}

ReadResult read_plain(std::string_view bytes, std::string_view name_hint, const ReadLimits& limits,
                      std::string_view size_field, io::InflateBudget& budget) {
    if (bytes.empty()) {
        throw Error(ErrorCode::InvalidInput, "the file is empty");
    }
    const MeshFormat format = io::detect_format(bytes, name_hint);
    if (!size_field.empty() && format != MeshFormat::Ply && format != MeshFormat::Vtp &&
        format != MeshFormat::Vtk) {
        throw Error(ErrorCode::Unsupported,
                    "sizes at vertices are read from PLY, VTP and VTK files, not from " +
                        std::string(format_name(format)));
    }
    switch (format) {
        case MeshFormat::Stl: return io::read_stl(bytes, limits);
        case MeshFormat::Ply: return io::read_ply(bytes, limits, size_field);
        case MeshFormat::Off: return io::read_off(bytes, limits);
        case MeshFormat::Obj: return io::read_obj(bytes, limits);
        case MeshFormat::Vtp: return io::read_vtp(bytes, limits, size_field, budget);
        case MeshFormat::Vtk: return io::read_vtk(bytes, limits, size_field);
        case MeshFormat::Gifti: return io::read_gifti(bytes, limits, budget);
        case MeshFormat::Vtu:
        case MeshFormat::Medit:
        case MeshFormat::Msh41:
        case MeshFormat::Msh22: break;
    }
    throw Error(ErrorCode::Unsupported, std::string(format_name(format)) + " files aren't read");
}

}  // namespace

ReadResult read_surface(std::string_view bytes, std::string_view name_hint,
                        const ReadLimits& limits, std::string_view size_field) {
    if (bytes.size() > limits.max_bytes) {
        throw Error(ErrorCode::TooLarge,
                    "the file has " + io::grouped(bytes.size()) + " bytes, more than the " +
                        io::grouped(static_cast<std::size_t>(limits.max_bytes)) +
                        " that may be read");
    }
    io::InflateBudget budget(bytes.size(), limits);
    if (!io::is_gzip(bytes)) {
        return read_plain(without_mark(bytes), name_hint, limits, size_field, budget);
    }
    // Tells what it is before anything large is inflated.
    io::refuse_other_formats(io::gunzip_head(bytes, io::kHead));
    const std::string plain = io::gunzip(bytes, budget);
    if (io::is_gzip(plain)) {
        throw Error(ErrorCode::InvalidInput, "the file is gzipped twice");
    }
    return read_plain(without_mark(plain), name_hint, limits, size_field, budget);
}

void write_surface(const SurfaceMesh& surface, MeshFormat format, std::ostream& out,
                   const std::vector<double>& sizes) {
    switch (format) {
        case MeshFormat::Stl: return io::write_stl(surface, out);
        case MeshFormat::Ply: return io::write_ply(surface, out, sizes);
        case MeshFormat::Off: return io::write_off(surface, out);
        case MeshFormat::Obj: return io::write_obj(surface, out);
        case MeshFormat::Vtp: return io::write_vtp(surface, out, sizes);
        case MeshFormat::Vtk: return io::write_vtk(surface, out, sizes);
        case MeshFormat::Gifti:
        case MeshFormat::Vtu:
        case MeshFormat::Medit:
        case MeshFormat::Msh41:
        case MeshFormat::Msh22: break;
    }
    refuse_to_write(format, "a surface");
}

void write_tets(const TetMesh& mesh, MeshFormat format, std::ostream& out,
                const std::vector<double>& sizes, const SurfaceMesh& boundary) {
    switch (format) {
        case MeshFormat::Vtk: return io::write_vtk(mesh, out, sizes);
        case MeshFormat::Vtu: return io::write_vtu(mesh, out, sizes);
        case MeshFormat::Medit: return io::write_medit(mesh, out, boundary);
        case MeshFormat::Msh41: return io::write_msh41(mesh, out, boundary);
        case MeshFormat::Msh22: return io::write_msh22(mesh, out, boundary);
        case MeshFormat::Stl:
        case MeshFormat::Ply:
        case MeshFormat::Off:
        case MeshFormat::Obj:
        case MeshFormat::Vtp:
        case MeshFormat::Gifti: break;
    }
    refuse_to_write(format, "a tetrahedral mesh");
}

std::optional<MeshFormat> format_of_name(std::string_view file_name) {
    std::string name = io::lower_case(file_name);
    if (name.ends_with(".gz")) {
        name.resize(name.size() - 3);
    }
    const std::size_t dot = name.rfind('.');
    const std::string extension = dot == std::string::npos ? "." + name : name.substr(dot);
    const auto* found = std::find_if(kFormats.begin(), kFormats.end(), [&](const auto& facts) {
        return facts.extension == extension;
    });
    if (found == kFormats.end()) {
        return {};
    }
    return found->format;
}

std::string_view format_name(MeshFormat format) {
    return facts_of(format).name;
}

std::optional<MeshFormat> format_from_string(std::string_view name) {
    for (const auto& facts : kFormats) {
        if (io::same_word(facts.name, name)) {
            return facts.format;
        }
    }
    return {};
}

bool can_read(MeshFormat format) {
    return facts_of(format).can_read;
}
bool can_write_surface(MeshFormat format) {
    return facts_of(format).can_write_surface;
}
bool can_write_tets(MeshFormat format) {
    return facts_of(format).can_write_tets;
}
std::string_view format_extension(MeshFormat format) {
    return facts_of(format).extension;
}

}  // namespace remesh

#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

enum class MeshFormat { Stl, Ply, Off, Obj, Vtp, Vtk, Gifti, Vtu, Medit, Msh41, Msh22 };

/// Bounds on what a file may ask for. Every declared count is checked against the bytes that are
/// there before memory is allocated.
struct ReadLimits {
    std::uint64_t max_bytes = std::uint64_t{2} << 30;  ///< Of the file after decompression.
    double max_expansion = 200.0;  ///< Decompressed size, of gzip and of arrays inside the file
                                   ///< together, over that of the file (for more than 1 MiB).
    std::int64_t max_triangles = 100'000'000;
};

struct ReadResult {
    SurfaceMesh mesh{};           ///< As in the file: nothing welded, polygons split to fans.
    std::vector<double> sizes{};  ///< #V wanted edge lengths, if a size_field was named; NaN: none.
    MeshFormat format = MeshFormat::Stl;
    std::vector<std::string>
        warnings{};  ///< E.g. "STL: coordinates that aren't finite in 3 triangles".
};

/// Reads a surface from the bytes of a file, gzipped or not.
///
/// The format is taken from the content where it has a signature; `name_hint` (a file name or
/// extension, may be empty) decides the rest. Never opens another file, whatever the bytes say.
///
/// Patches come from OBJ groups and objects, STL solids by name, a face property "patch" of PLY,
/// and the cell array "patch" of VTP and VTK or else their first array of whole numbers that
/// isn't a numbering of the cells. There are none unless at least two are told apart; they're
/// numbered from 0 without gaps.
///
/// \param size_field  name of a scalar per vertex that is read as `sizes`, or empty: a vertex
/// property of PLY, a point array of one component of VTP and VTK. What isn't greater than 0 is no
/// wish
/// \throws Error{InvalidInput} if there is no such scalar
/// \throws Error{Unsupported} for a size_field in another format
/// \throws Error{InvalidInput} saying what is wrong and where ("STL says 4,000,000 triangles but
/// holds 498")
/// \throws Error{Unsupported} for a known format that holds no surface we can read (a NIfTI label
/// map, a ZIP)
/// \throws Error{TooLarge} if a limit would be passed
ReadResult read_surface(std::string_view bytes, std::string_view name_hint,
                        const ReadLimits& limits = {}, std::string_view size_field = {});

/// Writes a surface: Stl (binary), Ply (binary), Off, Obj, Vtp (zlib, inline base64), Vtk (legacy,
/// binary). Patches go to OBJ groups, STL is one solid, VTP and VTK cell data "patch", PLY a face
/// property. Sizes are point data "h" of VTP, VTK and VTU and a vertex property "h" of PLY. Whether
/// all could be written is told by the state of `out`. \throws Error{Unsupported} for another
/// format \throws Error{InvalidInput} for coordinates beyond single precision in STL
void write_surface(const SurfaceMesh& surface, MeshFormat format, std::ostream& out,
                   const std::vector<double>& sizes = {});

/// Writes tets: Vtu (zlib, appended or inline base64), Vtk (legacy, binary), Medit (.mesh, ASCII,
/// with boundary triangles), Msh41 and Msh22 (gmsh ASCII, physical names, with boundary triangles).
/// The label of a boundary triangle is its patch + 1 if the boundary has patches, whose names are
/// physical names then; else it is the region that it bounds.
///
/// \param boundary  with its triangles in the order of boundary_of(mesh.tets); only its patches
/// count, and it may be empty
/// \throws Error{Unsupported} for another format
/// \throws Error{InvalidInput} for a region below 1 in Medit, Msh41 and Msh22
void write_tets(const TetMesh& mesh, MeshFormat format, std::ostream& out,
                const std::vector<double>& sizes = {}, const SurfaceMesh& boundary = {});

/// By extension (".gz" ignored), any case; nothing for an unknown one. ".msh" is Msh41.
[[nodiscard]] std::optional<MeshFormat> format_of_name(std::string_view file_name);

/// Canonical lower-case name, e.g. "stl", "msh22"; and back.
[[nodiscard]] std::string_view format_name(MeshFormat format);
[[nodiscard]] std::optional<MeshFormat> format_from_string(std::string_view name);

[[nodiscard]] bool can_read(MeshFormat format);
[[nodiscard]] bool can_write_surface(MeshFormat format);
[[nodiscard]] bool can_write_tets(MeshFormat format);
/// Usual extension with its dot, e.g. ".stl".
[[nodiscard]] std::string_view format_extension(MeshFormat format);

}  // namespace remesh

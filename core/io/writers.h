#pragma once

#include <iosfwd>
#include <vector>

#include "core/mesh/mesh.h"

/// One writer for each format; those that know scalars of vertices take #V sizes, or none, those
/// that write the boundary of tets take its patches, as write_tets() documents. Whether all was
/// written is told by the state of `out`.
namespace remesh::io {

void write_stl(const SurfaceMesh& surface, std::ostream& out);
void write_ply(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes);
void write_off(const SurfaceMesh& surface, std::ostream& out);
void write_obj(const SurfaceMesh& surface, std::ostream& out);
void write_vtp(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes);
void write_vtk(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes);

void write_vtu(const TetMesh& mesh, std::ostream& out, const std::vector<double>& sizes);
void write_vtk(const TetMesh& mesh, std::ostream& out, const std::vector<double>& sizes);
void write_medit(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches);
void write_msh41(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches);
void write_msh22(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches);

}  // namespace remesh::io

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/mesh_io.h"

namespace remesh::io {

/// Collects what a reader finds and checks what all formats have in common: indices in range, the
/// number of triangles, coordinates that are finite, patches that tell parts apart.
class SurfaceBuilder {
public:
    /// \param name  of the format in messages, e.g. "STL"
    SurfaceBuilder(MeshFormat format, std::string_view name, const ReadLimits& limits);

    /// Makes room. Call only with counts that the bytes of the file can hold.
    void reserve(std::int64_t vertices, std::int64_t triangles);

    void add_vertex(const Vec3& position);
    [[nodiscard]] std::int64_t vertex_count() const;
    [[nodiscard]] std::int64_t triangle_count() const;

    /// A polygon as a fan around its first corner. Faces with fewer than three corners are left
    /// out with a warning. \throws Error{InvalidInput} for an index that no vertex can have
    void add_face(std::span<const std::int64_t> corners);
    void add_strip(std::span<const std::int64_t> corners);

    /// Sizes of all vertices; what isn't greater than 0 and finite is no wish.
    /// \throws Error{InvalidInput} if there aren't as many as vertices
    void set_sizes(std::vector<double> sizes, std::string_view field);

    /// Faces added from now on belong to this patch. A reader uses names or numbers, not both.
    void begin_patch(std::string_view name);
    void begin_patch(std::int32_t id) { patch_ = id; }
    /// Names of patches 0, 1, ..., where the file has them apart from their numbers.
    void name_patches(std::vector<std::string> names) { names_ = std::move(names); }

    void warn(const std::string& message);

    /// The mesh, with patches only if there are at least two of them.
    /// \throws Error{InvalidInput} if there are no triangles or an index is out of range
    [[nodiscard]] ReadResult finish();

private:
    void add_triangle(std::int64_t a, std::int64_t b, std::int64_t c);
    void check_indices() const;
    void settle_patches();
    void warn_not_finite();

    std::string name_;
    std::int64_t max_triangles_;
    ReadResult result_{};
    std::int32_t patch_ = 0;
    std::vector<std::string> names_{};
    std::map<std::string, std::int32_t, std::less<>> patch_of_name_{};
    std::int64_t faces_ = 0;
    std::int64_t thin_faces_ = 0;
};

}  // namespace remesh::io

#include "core/io/surface_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

constexpr std::int64_t kMaxVertices = std::numeric_limits<Index>::max();
constexpr std::size_t kMaxPatches = 65'536;

}  // namespace

SurfaceBuilder::SurfaceBuilder(MeshFormat format, std::string_view name, const ReadLimits& limits)
    : name_(name), max_triangles_(limits.max_triangles) {
    result_.format = format;
}

void SurfaceBuilder::reserve(std::int64_t vertices, std::int64_t triangles) {
    result_.mesh.vertices.reserve(
        static_cast<std::size_t>(std::clamp<std::int64_t>(vertices, 0, kMaxVertices)));
    result_.mesh.triangles.reserve(
        static_cast<std::size_t>(std::clamp<std::int64_t>(triangles, 0, max_triangles_)));
}

void SurfaceBuilder::add_vertex(const Vec3& position) {
    if (vertex_count() == kMaxVertices) {
        throw Error(ErrorCode::TooLarge,
                    name_ + " holds more than " + grouped(kMaxVertices) + " vertices");
    }
    result_.mesh.vertices.push_back(position);
}

std::int64_t SurfaceBuilder::vertex_count() const {
    return static_cast<std::int64_t>(result_.mesh.vertices.size());
}

std::int64_t SurfaceBuilder::triangle_count() const {
    return static_cast<std::int64_t>(result_.mesh.triangles.size());
}

void SurfaceBuilder::set_sizes(std::vector<double> sizes, std::string_view field) {
    if (sizes.size() != result_.mesh.vertices.size()) {
        throw Error(ErrorCode::InvalidInput,
                    name_ + ": " + (sizes.empty() ? "no" : grouped(sizes.size())) +
                        " values of a scalar " + quoted(field) + " for " +
                        grouped(result_.mesh.vertices.size()) + " vertices");
    }
    for (double& size : sizes) {
        if (!(size > 0.0 && std::isfinite(size))) {
            size = std::numeric_limits<double>::quiet_NaN();
        }
    }
    result_.sizes = std::move(sizes);
}

void SurfaceBuilder::add_face(std::span<const std::int64_t> corners) {
    ++faces_;
    if (corners.size() < 3) {
        ++thin_faces_;
    }
    for (std::size_t i = 2; i < corners.size(); ++i) {
        add_triangle(corners[0], corners[i - 1], corners[i]);
    }
}

void SurfaceBuilder::add_strip(std::span<const std::int64_t> corners) {
    ++faces_;
    for (std::size_t i = 2; i < corners.size(); ++i) {
        // Every other triangle of a strip runs the other way round.
        const std::size_t odd = i % 2;
        add_triangle(corners[i - 2 + odd], corners[i - 1 - odd], corners[i]);
    }
}

void SurfaceBuilder::add_triangle(std::int64_t a, std::int64_t b, std::int64_t c) {
    for (const std::int64_t v : {a, b, c}) {
        if (v < 0 || v >= kMaxVertices) {
            throw Error(ErrorCode::InvalidInput, name_ + ": face " + grouped(faces_) +
                                                     " refers to vertex " + grouped(v) +
                                                     ", counting from 0");
        }
    }
    if (triangle_count() == max_triangles_) {
        throw Error(ErrorCode::TooLarge, name_ + " holds more than the " + grouped(max_triangles_) +
                                             " triangles that may be read");
    }
    result_.mesh.triangles.push_back(
        {static_cast<Index>(a), static_cast<Index>(b), static_cast<Index>(c)});
    // Most files have no patches: the list begins when the first one other than 0 does.
    auto& patch = result_.mesh.patch;
    if (patch_ != 0 || !patch.empty()) {
        patch.resize(result_.mesh.triangles.size() - 1, 0);
        patch.push_back(patch_);
    }
}

void SurfaceBuilder::begin_patch(std::string_view name) {
    const auto found = patch_of_name_.find(name);
    if (found != patch_of_name_.end()) {
        patch_ = found->second;
    } else if (names_.size() <= kMaxPatches) {
        patch_ = static_cast<std::int32_t>(names_.size());
        names_.emplace_back(name);
        patch_of_name_.emplace(name, patch_);
    }
}

void SurfaceBuilder::warn(const std::string& message) {
    result_.warnings.push_back(name_ + ": " + message);
}

ReadResult SurfaceBuilder::finish() {
    if (result_.mesh.triangles.empty()) {
        throw Error(ErrorCode::InvalidInput,
                    name_ + " holds no triangles, only " + grouped(vertex_count()) + " vertices");
    }
    check_indices();
    if (thin_faces_ > 0) {
        warn("left out: " + counted(thin_faces_, "face") + " with fewer than 3 corners");
    }
    warn_not_finite();
    settle_patches();
    return std::move(result_);
}

void SurfaceBuilder::check_indices() const {
    const auto count = static_cast<Index>(vertex_count());
    const auto& triangles = result_.mesh.triangles;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Index largest = std::max({triangles[t][0], triangles[t][1], triangles[t][2]});
        if (largest >= count) {
            throw Error(ErrorCode::InvalidInput,
                        name_ + ": triangle " + grouped(t + 1) + " refers to vertex " +
                            grouped(std::int64_t{largest}) + ", counting from 0, but there are " +
                            grouped(std::int64_t{count}) + " vertices");
        }
    }
}

void SurfaceBuilder::warn_not_finite() {
    const auto& mesh = result_.mesh;
    const auto is_bad = [&](Index v) {
        return !mesh.vertices[static_cast<std::size_t>(v)].allFinite();
    };
    const auto bad = std::count_if(
        mesh.triangles.begin(), mesh.triangles.end(),
        [&](const Triangle& t) { return is_bad(t[0]) || is_bad(t[1]) || is_bad(t[2]); });
    if (bad > 0) {
        warn("coordinates that aren't finite in " + counted(bad, "triangle"));
    }
}

void SurfaceBuilder::settle_patches() {
    auto& mesh = result_.mesh;
    std::vector<std::int32_t> used = mesh.patch;
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    if (used.size() < 2 || used.size() > kMaxPatches) {
        if (used.size() > kMaxPatches) {
            warn("more than " + grouped(kMaxPatches) + " patches: they were left out");
        }
        mesh.patch.clear();
        return;
    }
    // Patches are numbered from 0 without gaps, in the order of the file's names or numbers.
    const auto names = static_cast<std::int64_t>(names_.size());
    for (const std::int32_t id : used) {
        mesh.patch_names.push_back(id >= 0 && id < names ? names_[static_cast<std::size_t>(id)]
                                                         : std::to_string(id));
    }
    for (auto& id : mesh.patch) {
        id = static_cast<std::int32_t>(std::lower_bound(used.begin(), used.end(), id) -
                                       used.begin());
    }
}

}  // namespace remesh::io

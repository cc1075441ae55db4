#include "tests/support/shapes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>

namespace remesh::testing {
namespace {

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}
Index index(std::size_t i) {
    return static_cast<Index>(i);
}

Index midpoint(SurfaceMesh& mesh, std::map<std::pair<Index, Index>, Index>& seen, Index a,
               Index b) {
    const auto key = std::minmax(a, b);
    const auto found = seen.find(key);
    if (found != seen.end()) {
        return found->second;
    }
    mesh.vertices.push_back((mesh.vertices[at(a)] + mesh.vertices[at(b)]).normalized());
    const Index made = index(mesh.vertices.size() - 1);
    seen.emplace(key, made);
    return made;
}

void add_quad(SurfaceMesh& mesh, Index a, Index b, Index c, Index d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
}

}  // namespace

SurfaceMesh unit_cube() {
    SurfaceMesh cube;
    for (int i = 0; i < 8; ++i) {
        cube.vertices.emplace_back(i & 1 ? 1.0 : 0.0, i & 2 ? 1.0 : 0.0, i & 4 ? 1.0 : 0.0);
    }
    add_quad(cube, 0, 2, 3, 1);
    add_quad(cube, 4, 5, 7, 6);
    add_quad(cube, 0, 1, 5, 4);
    add_quad(cube, 2, 6, 7, 3);
    add_quad(cube, 0, 4, 6, 2);
    add_quad(cube, 1, 3, 7, 5);
    return cube;
}

SurfaceMesh icosphere(int levels) {
    SurfaceMesh mesh;
    const double g = std::numbers::phi;
    mesh.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                     {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    for (auto& v : mesh.vertices) {
        v.normalize();
    }
    mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                      {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                      {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                      {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<Index, Index>, Index> seen;
        std::vector<Triangle> finer;
        finer.reserve(mesh.triangles.size() * 4);
        for (const auto& [a, b, c] : mesh.triangles) {
            const Index ab = midpoint(mesh, seen, a, b);
            const Index bc = midpoint(mesh, seen, b, c);
            const Index ca = midpoint(mesh, seen, c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
        }
        mesh.triangles = std::move(finer);
    }
    return mesh;
}

SurfaceMesh torus(double major, double minor, int around, int across) {
    SurfaceMesh mesh;
    for (int i = 0; i < around; ++i) {
        const double u = 2.0 * std::numbers::pi * i / around;
        for (int j = 0; j < across; ++j) {
            const double v = 2.0 * std::numbers::pi * j / across;
            const double r = major + minor * std::cos(v);
            mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), minor * std::sin(v));
        }
    }
    const auto id = [&](int i, int j) { return Index{(i % around) * across + j % across}; };
    for (int i = 0; i < around; ++i) {
        for (int j = 0; j < across; ++j) {
            add_quad(mesh, id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
        }
    }
    return mesh;
}

SurfaceMesh l_shape() {
    SurfaceMesh mesh;
    const std::vector<std::pair<double, double>> outline{{0, 0}, {2, 0}, {2, 1},
                                                         {1, 1}, {1, 2}, {0, 2}};
    for (const double z : {0.0, 1.0}) {
        for (const auto& [x, y] : outline) {
            mesh.vertices.emplace_back(x, y, z);
        }
    }
    for (const auto& [a, b, c] :
         std::vector<Triangle>{{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}}) {
        mesh.triangles.push_back({a, c, b});
        mesh.triangles.push_back({a + 6, b + 6, c + 6});
    }
    for (Index i = 0; i < 6; ++i) {
        const Index j = (i + 1) % 6;
        add_quad(mesh, i, j, j + 6, i + 6);
    }
    return mesh;
}

SurfaceMesh level_set(const std::function<double(const Vec3&)>& value, const Box& box,
                      double cell) {
    const Eigen::Vector3i n = ((box.high - box.low) / cell).array().ceil().cast<int>() + 1;
    const auto corner_id = [&](int i, int j, int k) { return (k * n.y() + j) * n.x() + i; };
    const auto corner = [&](int id) {
        return Vec3(box.low + cell * Vec3(id % n.x(), (id / n.x()) % n.y(), id / (n.x() * n.y())));
    };
    std::vector<double> field(at(n.prod()));
    for (int id = 0; id < n.prod(); ++id) {
        const double f = value(corner(id));
        field[at(id)] = std::abs(f) < 1e-9 ? 1e-9 : f;
    }

    SurfaceMesh mesh;
    std::map<std::pair<int, int>, Index> seen;
    const auto vertex = [&](int a, int b) {
        const auto key = std::minmax(a, b);
        const auto found = seen.find(key);
        if (found != seen.end()) {
            return found->second;
        }
        const double t = field[at(key.first)] / (field[at(key.first)] - field[at(key.second)]);
        mesh.vertices.push_back(corner(key.first) + t * (corner(key.second) - corner(key.first)));
        const Index made = index(mesh.vertices.size() - 1);
        seen.emplace(key, made);
        return made;
    };
    const auto add = [&](Triangle t, const Vec3& outward) {
        const Vec3& a = mesh.vertices[at(t[0])];
        if ((mesh.vertices[at(t[1])] - a).cross(mesh.vertices[at(t[2])] - a).dot(outward) < 0) {
            std::swap(t[1], t[2]);
        }
        mesh.triangles.push_back(t);
    };
    constexpr std::array<std::array<int, 4>, 6> kTets{
        {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
    for (int k = 0; k + 1 < n.z(); ++k) {
        for (int j = 0; j + 1 < n.y(); ++j) {
            for (int i = 0; i + 1 < n.x(); ++i) {
                for (const auto& tet : kTets) {
                    std::vector<int> in;
                    std::vector<int> out;
                    for (const int c : tet) {
                        const int id = corner_id(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2));
                        (field[at(id)] < 0 ? in : out).push_back(id);
                    }
                    if (in.empty() || out.empty()) {
                        continue;
                    }
                    const Vec3 outward = corner(out[0]) - corner(in[0]);
                    if (in.size() == 1) {
                        add({vertex(in[0], out[0]), vertex(in[0], out[1]), vertex(in[0], out[2])},
                            outward);
                    } else if (out.size() == 1) {
                        add({vertex(out[0], in[0]), vertex(out[0], in[1]), vertex(out[0], in[2])},
                            outward);
                    } else {
                        const Index a = vertex(in[0], out[0]);
                        const Index b = vertex(in[0], out[1]);
                        const Index c = vertex(in[1], out[1]);
                        const Index d = vertex(in[1], out[0]);
                        add({a, b, c}, outward);
                        add({a, c, d}, outward);
                    }
                }
            }
        }
    }
    return mesh;
}

SurfaceMesh voxel_surface(const std::function<bool(const Vec3&)>& inside, const Box& box,
                          double cell) {
    const Eigen::Vector3i n = ((box.high - box.low) / cell).array().ceil().cast<int>();
    const auto filled = [&](const Eigen::Vector3i& c) {
        return (c.array() >= 0).all() && (c.array() < n.array()).all() &&
               inside(box.low + cell * (c.cast<double>() + Vec3::Constant(0.5)));
    };
    SurfaceMesh mesh;
    std::map<std::array<int, 3>, Index> seen;
    const auto vertex = [&](const Eigen::Vector3i& c) {
        const auto [found, is_new] =
            seen.try_emplace({c.x(), c.y(), c.z()}, index(mesh.vertices.size()));
        if (is_new) {
            mesh.vertices.push_back(box.low + cell * c.cast<double>());
        }
        return found->second;
    };
    for (int id = 0; id < n.prod(); ++id) {
        const Eigen::Vector3i c(id % n.x(), (id / n.x()) % n.y(), id / (n.x() * n.y()));
        if (!filled(c)) {
            continue;
        }
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3i e = Eigen::Vector3i::Unit(axis);
            const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3);
            const Eigen::Vector3i v = Eigen::Vector3i::Unit((axis + 2) % 3);
            if (!filled(c + e)) {
                add_quad(mesh, vertex(c + e), vertex(c + e + u), vertex(c + e + u + v),
                         vertex(c + e + v));
            }
            if (!filled(c - e)) {
                add_quad(mesh, vertex(c), vertex(c + v), vertex(c + u + v), vertex(c + u));
            }
        }
    }
    return mesh;
}

SurfaceMesh with_triangles_removed(SurfaceMesh surface, double fraction, unsigned seed) {
    std::mt19937 random(seed);
    std::erase_if(surface.triangles, [&](const Triangle&) {
        return std::uniform_real_distribution<>(0, 1)(random) < fraction;
    });
    return surface;
}

SurfaceMesh with_triangles_flipped(SurfaceMesh surface, double fraction, unsigned seed) {
    std::mt19937 random(seed);
    for (auto& triangle : surface.triangles) {
        if (std::uniform_real_distribution<>(0, 1)(random) < fraction) {
            std::swap(triangle[0], triangle[1]);
        }
    }
    return surface;
}

SurfaceMesh with_noise(SurfaceMesh surface, double sigma, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<> noise(0.0, sigma);
    for (auto& v : surface.vertices) {
        v += Vec3(noise(random), noise(random), noise(random));
    }
    return surface;
}

SurfaceMesh as_soup(const SurfaceMesh& surface) {
    SurfaceMesh soup;
    for (const auto& triangle : surface.triangles) {
        Triangle made{};
        for (std::size_t corner = 0; corner < 3; ++corner) {
            made[corner] = index(soup.vertices.size());
            soup.vertices.push_back(surface.vertices[at(triangle[corner])]);
        }
        soup.triangles.push_back(made);
    }
    return soup;
}

SurfaceMesh join(SurfaceMesh a, const SurfaceMesh& b) {
    const Index shift = index(a.vertices.size());
    a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
    for (const auto& [i, j, k] : b.triangles) {
        a.triangles.push_back({i + shift, j + shift, k + shift});
    }
    return a;
}

SurfaceMesh transformed(SurfaceMesh surface, const Eigen::Matrix3d& linear, const Vec3& shift) {
    for (auto& v : surface.vertices) {
        v = linear * v + shift;
    }
    return surface;
}

}  // namespace remesh::testing

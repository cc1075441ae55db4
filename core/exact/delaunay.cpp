#include "core/exact/delaunay.h"

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_3.h>
#include <CGAL/Triangulation_cell_base_with_info_3.h>
#include <CGAL/Triangulation_data_structure_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>
#include <CGAL/property_map.h>
#include <CGAL/spatial_sort.h>

#include <algorithm>
#include <numeric>

namespace remesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<Index, Kernel>;
// The index fits into the padding of CGAL's cell, so it costs no memory.
using CellBase =
    CGAL::Triangulation_cell_base_with_info_3<Index, Kernel,
                                              CGAL::Delaunay_triangulation_cell_base_3<Kernel>>;
using Structure = CGAL::Triangulation_data_structure_3<VertexBase, CellBase>;
using Delaunay = CGAL::Delaunay_triangulation_3<Kernel, Structure>;

// Points along a space-filling curve, in rounds of growing density: each is found a few steps from
// the one before.
std::vector<std::size_t> insertion_order(const std::vector<Point>& points) {
    std::vector<std::size_t> order(points.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto position = CGAL::make_property_map(points.data());
    CGAL::spatial_sort(order.begin(), order.end(),
                       CGAL::Spatial_sort_traits_adapter_3<Kernel, decltype(position)>(position));
    return order;
}

Delaunay triangulate(const Points& positions) {
    std::vector<Point> points;
    points.reserve(positions.size());
    for (const auto& p : positions) {
        points.emplace_back(p.x(), p.y(), p.z());
    }

    Delaunay delaunay;
    Delaunay::Vertex_handle last;
    for (const auto i : insertion_order(points)) {
        const auto before = delaunay.number_of_vertices();
        last = delaunay.insert(points[i], last);
        const auto index = static_cast<Index>(i);
        const bool is_new = delaunay.number_of_vertices() > before;
        last->info() = is_new ? index : std::min(last->info(), index);
    }
    return delaunay;
}

}  // namespace

TetComplex delaunay_cells(const Points& points) {
    const Delaunay delaunay = triangulate(points);
    TetComplex complex;
    if (delaunay.dimension() < 3) {
        return complex;
    }

    Index count = 0;
    for (const auto cell : delaunay.all_cell_handles()) {
        cell->info() = delaunay.is_infinite(cell) ? kNone : count++;
    }
    complex.tets.resize(static_cast<std::size_t>(count));
    complex.neighbours.resize(static_cast<std::size_t>(count));
    for (const auto cell : delaunay.all_cell_handles()) {
        if (cell->info() == kNone) {
            continue;
        }
        const auto t = static_cast<std::size_t>(cell->info());
        for (int corner = 0; corner < 4; ++corner) {
            complex.tets[t][static_cast<std::size_t>(corner)] = cell->vertex(corner)->info();
            complex.neighbours[t][static_cast<std::size_t>(corner)] =
                cell->neighbor(corner)->info();
        }
    }
    return complex;
}

}  // namespace remesh

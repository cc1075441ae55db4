#include "server/convert/sizing.h"

#include <string>
#include <utility>

#include "server/convert.h"

namespace remesh {
namespace {

using Coordinates = google::protobuf::RepeatedField<double>;

Points points_of(const Coordinates& numbers, const std::string& field) {
    if (numbers.size() % 3 != 0) {
        refuse(field, "must be 3 numbers a point, got " + std::to_string(numbers.size()));
    }
    Points points;
    for (int i = 0; i < numbers.size(); i += 3) {
        points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    }
    return points;
}

Vec3 point_of(const Coordinates& numbers, const std::string& field) {
    if (numbers.size() != 3) {
        refuse(field, "must be 3 numbers, got " + std::to_string(numbers.size()));
    }
    return {numbers[0], numbers[1], numbers[2]};
}

void write(const Vec3& x, Coordinates* to) {
    to->Add(x.begin(), x.end());
}

void write(const Points& points, Coordinates* to) {
    for (const Vec3& x : points) {
        write(x, to);
    }
}

SizingRegion to_core(const v1::SizingRegion& from, const std::string& field) {
    SizingRegion to;
    switch (from.shape_case()) {
        case v1::SizingRegion::kPoints:
            to.shape =
                SizingPoints{points_of(from.points().coordinates(), field + ".points.coordinates")};
            break;
        case v1::SizingRegion::kPolyline:
            to.shape = SizingPolyline{
                points_of(from.polyline().coordinates(), field + ".polyline.coordinates")};
            break;
        case v1::SizingRegion::kSphere:
            to.shape = SizingSphere{point_of(from.sphere().center(), field + ".sphere.center"),
                                    from.sphere().radius()};
            break;
        case v1::SizingRegion::kBox:
            to.shape = SizingBox{point_of(from.box().low(), field + ".box.low"),
                                 point_of(from.box().high(), field + ".box.high")};
            break;
        case v1::SizingRegion::SHAPE_NOT_SET:
            refuse(field, "must have a shape: points, polyline, sphere or box");
    }
    to.size = from.size();
    if (from.has_growth()) {
        to.growth = from.growth();
    }
    return to;
}

v1::SizingRegion to_proto(const SizingRegion& from) {
    v1::SizingRegion to;
    if (const auto* points = std::get_if<SizingPoints>(&from.shape)) {
        write(points->points, to.mutable_points()->mutable_coordinates());
    } else if (const auto* line = std::get_if<SizingPolyline>(&from.shape)) {
        write(line->points, to.mutable_polyline()->mutable_coordinates());
    } else if (const auto* sphere = std::get_if<SizingSphere>(&from.shape)) {
        write(sphere->center, to.mutable_sphere()->mutable_center());
        to.mutable_sphere()->set_radius(sphere->radius);
    } else if (const auto* box = std::get_if<SizingBox>(&from.shape)) {
        write(box->low, to.mutable_box()->mutable_low());
        write(box->high, to.mutable_box()->mutable_high());
    }
    to.set_size(from.size);
    if (from.growth) {
        to.set_growth(*from.growth);
    }
    return to;
}

Propagation to_core(v1::Sizing::Propagation propagation, Propagation otherwise) {
    switch (propagation) {
        case v1::Sizing::PROPAGATION_LIPSCHITZ: return Propagation::Lipschitz;
        case v1::Sizing::PROPAGATION_MULTIGRID: return Propagation::Multigrid;
        case v1::Sizing::PROPAGATION_COUPLED: return Propagation::Coupled;
        default: return otherwise;
    }
}

v1::Sizing::Propagation to_proto(Propagation propagation) {
    switch (propagation) {
        case Propagation::Lipschitz: return v1::Sizing::PROPAGATION_LIPSCHITZ;
        case Propagation::Multigrid: return v1::Sizing::PROPAGATION_MULTIGRID;
        case Propagation::Coupled: return v1::Sizing::PROPAGATION_COUPLED;
    }
    return v1::Sizing::PROPAGATION_UNSPECIFIED;
}

}  // namespace

SizingOptions to_core(const v1::Sizing& from) {
    SizingOptions to;
    to.guard_thickness = from.has_guard_thickness() ? from.guard_thickness() : to.guard_thickness;
    if (from.has_min_size()) {
        to.min_size = from.min_size();
    }
    if (from.has_max_size()) {
        to.max_size = from.max_size();
    }
    to.gradation = from.has_gradation() ? from.gradation() : to.gradation;
    to.propagation = to_core(from.propagation(), to.propagation);
    if (from.has_reaction()) {
        to.reaction = from.reaction();
    }
    if (from.has_chord_error()) {
        to.chord_error = from.chord_error();
    }
    if (from.has_elements_across()) {
        to.elements_across = from.elements_across();
    }
    if (from.has_boundary_layer()) {
        const v1::BoundaryLayer& layer = from.boundary_layer();
        BoundaryLayer& wanted = to.layer.emplace();
        wanted.first_size = layer.first_size();
        wanted.growth = layer.has_growth() ? layer.growth() : wanted.growth;
    }
    to.vertex_field = from.vertex_field();
    to.return_field = from.return_field();
    for (int i = 0; i < from.regions_size(); ++i) {
        to.regions.push_back(to_core(from.regions(i), "sizing.regions[" + std::to_string(i) + "]"));
    }
    return to;
}

v1::Sizing to_proto(const SizingOptions& from) {
    v1::Sizing to;
    to.set_guard_thickness(from.guard_thickness);
    if (from.min_size) {
        to.set_min_size(*from.min_size);
    }
    if (from.max_size) {
        to.set_max_size(*from.max_size);
    }
    to.set_gradation(from.gradation);
    to.set_propagation(to_proto(from.propagation));
    if (from.reaction) {
        to.set_reaction(*from.reaction);
    }
    if (from.chord_error) {
        to.set_chord_error(*from.chord_error);
    }
    if (from.elements_across) {
        to.set_elements_across(*from.elements_across);
    }
    if (from.layer) {
        to.mutable_boundary_layer()->set_first_size(from.layer->first_size);
        to.mutable_boundary_layer()->set_growth(from.layer->growth);
    }
    if (!from.vertex_field.empty()) {
        to.set_vertex_field(from.vertex_field);
    }
    to.set_return_field(from.return_field);
    for (const SizingRegion& region : from.regions) {
        *to.add_regions() = to_proto(region);
    }
    return to;
}

}  // namespace remesh

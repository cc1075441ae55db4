#include "client/sizing_options.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <charconv>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "client/flags.h"

namespace remesh::client {
namespace {

[[noreturn]] void refuse(const std::string& flag, const std::string& rule, const std::string& got) {
    throw CLI::ValidationError(flag, fmt::format("must be {}, got {}", rule, got));
}

std::vector<std::string_view> split(std::string_view text, char separator) {
    std::vector<std::string_view> parts;
    for (std::size_t from = 0; from <= text.size();) {
        const std::size_t to = std::min(text.find(separator, from), text.size());
        parts.push_back(text.substr(from, to - from));
        from = to + 1;
    }
    return parts;
}

/// Numbers parted by commas; empty if anything else is there.
std::vector<double> numbers_of(std::string_view text) {
    std::vector<double> numbers;
    for (const std::string_view part : split(text, ',')) {
        double number = 0.0;
        const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), number);
        if (error != std::errc{} || end != part.data() + part.size()) {
            return {};
        }
        numbers.push_back(number);
    }
    return numbers;
}

void read_layer(const std::string& text, v1::Sizing& sizing) {
    const std::vector<double> numbers = numbers_of(text);
    if (numbers.empty() || numbers.size() > 2) {
        refuse("--size-layer", "FIRST or FIRST,GROWTH", text);
    }
    sizing.mutable_boundary_layer()->set_first_size(numbers[0]);
    if (numbers.size() == 2) {
        sizing.mutable_boundary_layer()->set_growth(numbers[1]);
    }
}

bool read_shape(std::string_view shape, const std::vector<double>& numbers,
                v1::SizingRegion& region) {
    const auto add = [&](auto* to, std::size_t from, std::size_t until) {
        for (std::size_t i = from; i < until; ++i) {
            to->Add(numbers[i]);
        }
    };
    const std::size_t n = numbers.size();
    if (shape == "sphere" && n == 4) {
        add(region.mutable_sphere()->mutable_center(), 0, 3);
        region.mutable_sphere()->set_radius(numbers[3]);
    } else if (shape == "box" && n == 6) {
        add(region.mutable_box()->mutable_low(), 0, 3);
        add(region.mutable_box()->mutable_high(), 3, 6);
    } else if (shape == "points" && n >= 3 && n % 3 == 0) {
        add(region.mutable_points()->mutable_coordinates(), 0, n);
    } else if (shape == "polyline" && n >= 6 && n % 3 == 0) {
        add(region.mutable_polyline()->mutable_coordinates(), 0, n);
    } else {
        return false;
    }
    return true;
}

/// SHAPE:NUMBERS:H[:GROWTH]
void read_region(const std::string& text, v1::Sizing& sizing) {
    const std::vector<std::string_view> parts = split(text, ':');
    v1::SizingRegion region;
    const bool is_complete = parts.size() == 3 || parts.size() == 4;
    const auto size = is_complete ? numbers_of(parts[2]) : std::vector<double>{};
    const auto growth = parts.size() == 4 ? numbers_of(parts[3]) : std::vector<double>{1.0};
    if (!is_complete || size.size() != 1 || growth.size() != 1 ||
        !read_shape(parts[0], numbers_of(parts[1]), region)) {
        refuse("--size-region",
               "sphere:X,Y,Z,R:H, box:X,Y,Z,X,Y,Z:H, points:X,Y,Z,...:H or polyline:X,Y,Z,...:H, "
               "each with :GROWTH if wanted",
               text);
    }
    region.set_size(size[0]);
    if (parts.size() == 4) {
        region.set_growth(growth[0]);
    }
    *sizing.add_regions() = std::move(region);
}

void read_file(const std::string& path, v1::Sizing& sizing) {
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file) {
        throw CLI::ValidationError("--sizing", "can't read " + path);
    }
    v1::Sizing read;
    const auto status = google::protobuf::util::JsonStringToMessage(text, &read);
    if (!status.ok()) {
        throw CLI::ValidationError("--sizing", fmt::format("{} is no remesh.v1.Sizing: {}", path,
                                                           std::string(status.message())));
    }
    sizing.MergeFrom(read);
}

template <typename Setter>
void add_text(CLI::App& command, const std::string& name, const std::string& type,
              const std::string& help, Setter set) {
    command
        .add_option_function<std::vector<std::string>>(
            name,
            [set](const std::vector<std::string>& texts) {
                for (const std::string& text : texts) {
                    set(text);
                }
            },
            help)
        ->type_name(type)
        ->allow_extra_args(false);
}

}  // namespace

void add_sizing_options(CLI::App& command, v1::Sizing& sizing) {
    command.option_defaults()->group("Sizes");
    // First, since options take effect in this order: flags win over the file.
    add_text(command, "--sizing", "FILE", "All of this as JSON, a remesh.v1.Sizing; flags win",
             [&](const std::string& path) { read_file(path, sizing); });
    add_value<double>(command, "--min-size", "H", "Smallest edge length that anything may ask for",
                      [&](double x) { sizing.set_min_size(x); });
    add_value<double>(command, "--max-size", "H", "Edge length where nothing asks for less",
                      [&](double x) { sizing.set_max_size(x); });
    add_value<double>(command, "--gradation", "G", "Growth of sizes over distance, in (0, 0.3]",
                      [&](double x) { sizing.set_gradation(x); });
    add_choice<v1::Sizing::Propagation>(command, "--propagation",
                                        {{"lipschitz", v1::Sizing::PROPAGATION_LIPSCHITZ},
                                         {"multigrid", v1::Sizing::PROPAGATION_MULTIGRID},
                                         {"coupled", v1::Sizing::PROPAGATION_COUPLED}},
                                        "How sizes spread: by the gradation, or also by diffusion",
                                        [&](auto x) { sizing.set_propagation(x); });
    add_value<double>(command, "--reaction", "R",
                      "Of the diffusion, < 0: sizes spread over 1 / sqrt(-R)",
                      [&](double x) { sizing.set_reaction(x); });
    add_value<double>(command, "--size-curvature", "EPS",
                      "Edges may leave the surface by this much",
                      [&](double x) { sizing.set_chord_error(x); });
    add_value<double>(command, "--size-across", "N", "Edges across the body, in [1, 16]",
                      [&](double x) { sizing.set_elements_across(x); });
    add_text(command, "--size-layer", "FIRST[,GROWTH]",
             "Edge length on the boundary, and its growth from layer to layer",
             [&](const std::string& text) { read_layer(text, sizing); });
    add_text(command, "--size-region", "SHAPE:NUMBERS:H[:GROWTH]",
             "Size in a sphere:X,Y,Z,R, a box:X,Y,Z,X,Y,Z, at points:X,Y,Z,... or along a "
             "polyline:X,Y,Z,...; repeatable",
             [&](const std::string& text) { read_region(text, sizing); });
    add_text(command, "--size-field", "NAME",
             "Scalar of the input's vertices that is the size there (PLY, VTP, VTK)",
             [&](const std::string& name) { sizing.set_vertex_field(name); });
    command.add_flag_function(
        "--return-sizes", [&](std::int64_t) { sizing.set_return_field(true); },
        "Also write the sizes asked for, as field h of the vertices");
    command.add_flag_function(
        "--no-thickness-guard", [&](std::int64_t) { sizing.set_guard_thickness(false); },
        "Don't refine where the body is thin");
}

}  // namespace remesh::client

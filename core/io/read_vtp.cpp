#include <algorithm>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"
#include "core/io/vtk_piece.h"
#include "core/io/vtk_xml_arrays.h"
#include "core/io/xml.h"

namespace remesh::io {
namespace {

constexpr const char* kName = "VTP";

// A file in two halves: XML, and what's appended, which may be anything but XML.
struct Halves {
    std::string xml{};
    std::string_view appended{};
    bool is_base64 = false;
};

Halves split(std::string_view bytes) {
    const std::size_t tag = bytes.find("<AppendedData");
    if (tag == std::string_view::npos) {
        return {.xml = std::string(bytes)};
    }
    const std::size_t tag_end = bytes.find('>', tag);
    const std::size_t data = bytes.find('_', tag_end);
    if (tag_end == std::string_view::npos || data == std::string_view::npos) {
        throw Error(ErrorCode::InvalidInput, "VTP: the file ends inside <AppendedData>");
    }
    return {.xml = std::string(bytes.substr(0, tag)) + "</VTKFile>",
            .appended = bytes.substr(data + 1),
            .is_base64 = bytes.substr(tag, tag_end - tag).find("base64") != std::string_view::npos};
}

pugi::xml_node named_array(const pugi::xml_node& parent, const char* name) {
    for (const auto& array : parent.children()) {
        if (same_word(array.attribute("Name").value(), name)) {
            return array;
        }
    }
    return {};
}

class VtpReader {
public:
    VtpReader(const pugi::xml_node& root, VtkXmlArrays arrays, const ReadLimits& limits,
              std::string_view size_field)
        : data_(root.child("PolyData")),
          size_field_(size_field),
          arrays_(arrays),
          builder_(MeshFormat::Vtp, kName, limits) {}

    ReadResult read() {
        for (const auto& piece : data_.children("Piece")) {
            add_piece(read_piece(piece), kName, builder_);
        }
        builder_.name_patches(read_patch_names());
        if (!size_field_.empty()) {
            builder_.set_sizes(std::move(sizes_), size_field_);
        }
        return builder_.finish();
    }

private:
    static std::int64_t declared(const pugi::xml_node& piece, const char* what) {
        return count_attribute(piece, what, kName, 0);
    }

    VtkPiece read_piece(const pugi::xml_node& node) {
        VtkPiece piece;
        const std::int64_t points = declared(node, "NumberOfPoints");
        if (points > 0) {
            piece.points = arrays_.reals(node.child("Points").child("DataArray"));
        }
        const auto held = static_cast<std::int64_t>(piece.points.size());
        if (held % 3 != 0 || held / 3 != points) {
            throw Error(ErrorCode::InvalidInput, "VTP says " + grouped(points) +
                                                     " points but holds " + grouped(held) +
                                                     " coordinates");
        }
        piece.polygons = read_cells(node.child("Polys"), declared(node, "NumberOfPolys"));
        piece.strips = read_cells(node.child("Strips"), declared(node, "NumberOfStrips"));
        piece.other_cells = declared(node, "NumberOfVerts") + declared(node, "NumberOfLines");
        piece.labels = read_labels(node.child("CellData"));
        read_sizes(node.child("PointData"));
        return piece;
    }

    void read_sizes(const pugi::xml_node& point_data) {
        for (const auto& array : point_data.children("DataArray")) {
            if (!size_field_.empty() && array.attribute("Name").value() == size_field_ &&
                count_attribute(array, "NumberOfComponents", kName, 1) == 1) {
                const auto sizes = arrays_.reals(array);
                sizes_.insert(sizes_.end(), sizes.begin(), sizes.end());
                return;
            }
        }
    }

    VtkCells read_cells(const pugi::xml_node& node, std::int64_t count) {
        VtkCells cells;
        if (count == 0) {
            return cells;
        }
        cells.corners = arrays_.integers(named_array(node, "connectivity"));
        cells.offsets = arrays_.integers(named_array(node, "offsets"));
        if (static_cast<std::int64_t>(cells.offsets.size()) != count) {
            throw Error(ErrorCode::InvalidInput, "VTP says " + grouped(count) + " cells in <" +
                                                     node.name() + "> but holds " +
                                                     grouped(cells.offsets.size()));
        }
        cells.offsets.insert(cells.offsets.begin(), 0);
        return cells;
    }

    // The array "patch", or else the first that numbers parts of the surface.
    std::vector<std::int64_t> read_labels(const pugi::xml_node& cell_data) {
        if (const auto patch = named_array(cell_data, "patch")) {
            return arrays_.integers(patch);
        }
        for (const auto& array : cell_data.children("DataArray")) {
            const std::string_view name = array.attribute("Name").value();
            if (name.starts_with("vtk") || !is_integer(vtk_xml_type(array)) ||
                count_attribute(array, "NumberOfComponents", kName, 1) != 1) {
                continue;
            }
            auto labels = arrays_.integers(array);
            if (can_be_patches(labels)) {
                return labels;
            }
        }
        return {};
    }

    std::vector<std::string> read_patch_names() {
        std::vector<std::string> names;
        const auto array = named_array(data_.child("FieldData"), "patch_names");
        if (!array) {
            return names;
        }
        std::string name;
        for (const std::int64_t c : arrays_.integers(array)) {
            if (c == 0) {
                names.push_back(std::move(name));
                name.clear();
            } else {
                name.push_back(static_cast<char>(c));
            }
        }
        return names;
    }

    pugi::xml_node data_;
    std::string_view size_field_;
    std::vector<double> sizes_{};
    VtkXmlArrays arrays_;
    SurfaceBuilder builder_;
};

}  // namespace

ReadResult read_vtp(std::string_view bytes, const ReadLimits& limits, std::string_view size_field,
                    InflateBudget& budget) {
    const Halves halves = split(bytes);
    pugi::xml_document document;
    parse_xml(halves.xml, kName, document);
    const auto root = document.child("VTKFile");
    const std::string_view type = root.attribute("type").value();
    if (type != "PolyData") {
        throw Error(ErrorCode::Unsupported, "VTK XML: the file holds " + quoted(type) +
                                                "; only PolyData, a surface, is read");
    }
    return VtpReader(root, VtkXmlArrays(root, halves.appended, halves.is_base64, budget), limits,
                     size_field)
        .read();
}

}  // namespace remesh::io

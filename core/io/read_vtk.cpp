#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"
#include "core/io/vtk_piece.h"

namespace remesh::io {
namespace {

std::optional<NumberType> number_type(std::string_view word) {
    constexpr std::array<std::pair<std::string_view, NumberType>, 20> kTypes{
        {{"char", NumberType::Int8},
         {"signed_char", NumberType::Int8},
         {"unsigned_char", NumberType::UInt8},
         {"short", NumberType::Int16},
         {"unsigned_short", NumberType::UInt16},
         {"int", NumberType::Int32},
         {"unsigned_int", NumberType::UInt32},
         {"long", NumberType::Int64},
         {"unsigned_long", NumberType::UInt64},
         {"long_long", NumberType::Int64},
         {"vtkidtype", NumberType::Int32},  // Written as int, whatever it is in memory.
         {"vtktypeint8", NumberType::Int8},
         {"vtktypeuint8", NumberType::UInt8},
         {"vtktypeint16", NumberType::Int16},
         {"vtktypeint32", NumberType::Int32},
         {"vtktypeuint32", NumberType::UInt32},
         {"vtktypeint64", NumberType::Int64},
         {"vtktypeuint64", NumberType::UInt64},
         {"float", NumberType::Float32},
         {"double", NumberType::Float64}}};
    for (const auto& [known, type] : kTypes) {
        if (same_word(word, known)) {
            return type;
        }
    }
    return {};
}

class VtkReader {
public:
    VtkReader(std::string_view bytes, const ReadLimits& limits, std::string_view size_field)
        : text_(bytes, "VTK"), builder_(MeshFormat::Vtk, "VTK", limits), size_field_(size_field) {}

    ReadResult read() {
        read_header();
        while (text_.skip_space()) {
            const TextReader before = text_;
            const std::string keyword = lower_case(text_.word());
            if (!read_geometry(keyword) && !read_attribute(keyword)) {
                if (piece_.polygons.offsets.empty() && piece_.strips.offsets.empty()) {
                    before.fail(quoted(keyword) + " was not expected here");
                }
                builder_.warn("what follows " + quoted(keyword) + " was ignored");
                break;
            }
        }
        piece_.labels = std::move(labels_);
        add_piece(piece_, "VTK", builder_);
        if (!size_field_.empty()) {
            builder_.set_sizes(std::move(sizes_), size_field_);
        }
        return builder_.finish();
    }

private:
    void read_header() {
        text_.rest_of_line();  // "# vtk DataFile Version x.y"
        text_.rest_of_line();  // The title.
        is_binary_ = text_.accept("BINARY");
        if (!is_binary_ && !text_.accept("ASCII")) {
            text_.fail("ASCII or BINARY was expected, not " + quoted(text_.word()));
        }
        if (!text_.accept("DATASET")) {
            text_.fail("DATASET was expected, not " + quoted(text_.word()));
        }
        if (!text_.accept("POLYDATA")) {
            throw Error(ErrorCode::Unsupported, "VTK: the file holds " + quoted(text_.word()) +
                                                    "; only POLYDATA, a surface, is read");
        }
    }

    bool read_geometry(const std::string& keyword) {
        if (keyword == "points") {
            const std::int64_t points = text_.count("number of points");
            const auto type = expect_type();
            check_room("points", points, 3 * size_of(type));
            piece_.points = reals(3 * points, type);
        } else if (keyword == "polygons") {
            piece_.polygons = read_cells();
        } else if (keyword == "triangle_strips") {
            piece_.strips = read_cells();
        } else if (keyword == "vertices" || keyword == "lines") {
            const VtkCells cells = read_cells();
            piece_.other_cells += cell_count(cells);
        } else if (keyword == "metadata") {
            while (text_.next_line() && text_.skip_blanks()) {
            }
        } else {
            return false;
        }
        return true;
    }

    // False for one that isn't known: nobody can say then where the next begins.
    bool read_attribute(const std::string& keyword) {
        if (keyword == "cell_data" || keyword == "point_data") {
            in_cell_data_ = keyword == "cell_data";
            tuples_ = text_.count("number of tuples");
            return true;
        }
        if (keyword == "field") {
            return read_field();
        }
        if (keyword == "scalars") {
            return read_scalars();
        }
        if (keyword == "lookup_table") {
            text_.word();
            const std::int64_t size = text_.count("size of a lookup table");
            return skip_array(size, 4, is_binary_ ? NumberType::UInt8 : NumberType::Float32);
        }
        if (keyword == "color_scalars") {
            text_.word();
            const std::int64_t components = text_.count("number of components");
            return skip_array(tuples_, components,
                              is_binary_ ? NumberType::UInt8 : NumberType::Float32);
        }
        return read_fixed_attribute(keyword);
    }

    bool read_fixed_attribute(const std::string& keyword) {
        std::int64_t components = 0;
        if (keyword == "vectors" || keyword == "normals") {
            components = 3;
        } else if (keyword == "tensors") {
            components = 9;
        } else if (keyword == "global_ids" || keyword == "pedigree_ids") {
            components = 1;
        } else if (keyword != "texture_coordinates") {
            return false;
        }
        text_.word();  // Its name.
        if (components == 0) {
            components = text_.count("number of texture coordinates");
        }
        const auto type = number_type(text_.word());
        return type && skip_array(tuples_, components, *type);
    }

    bool read_scalars() {
        const std::string name(text_.word());
        const auto type = number_type(text_.word());
        const std::int64_t components =
            text_.skip_blanks() ? text_.count("number of components") : 1;
        if (!type) {
            return false;
        }
        TextReader ahead = text_;
        if (ahead.accept("LOOKUP_TABLE")) {
            text_ = ahead;
            text_.word();
        }
        return keep_or_skip(name, tuples_, components, *type);
    }

    bool read_field() {
        text_.word();
        const std::int64_t arrays = text_.count("number of arrays");
        for (std::int64_t i = 0; i < arrays; ++i) {
            if (!text_.skip_space()) {
                text_.fail("the file ends inside a field");
            }
            const std::string name(text_.word());
            if (same_word(name, "METADATA")) {
                read_geometry("metadata");
                --i;
                continue;
            }
            const std::int64_t components = text_.count("number of components");
            const std::int64_t tuples = text_.count("number of tuples");
            const auto type = number_type(text_.word());
            if (!type || !keep_or_skip(name, tuples, components, *type)) {
                return false;
            }
        }
        return true;
    }

    // Keeps integers of cells that may be patches and the sizes of points, skips all else.
    bool keep_or_skip(const std::string& name, std::int64_t tuples, std::int64_t components,
                      NumberType type) {
        const auto points = static_cast<std::int64_t>(piece_.points.size() / 3);
        if (!in_cell_data_ && !size_field_.empty() && name == size_field_ && components == 1 &&
            tuples == points) {
            check_room(name, tuples, size_of(type));
            sizes_ = reals(tuples, type);
            return true;
        }
        const bool is_patch = same_word(name, "patch");
        if (!in_cell_data_ || components != 1 || name.starts_with("vtk") || has_patch_ ||
            !(is_patch || (is_integer(type) && labels_.empty()))) {
            return skip_array(tuples, components, type);
        }
        check_room(name, tuples, size_of(type));
        auto labels = integers(tuples, type);
        if (is_patch || can_be_patches(labels)) {
            labels_ = std::move(labels);
            has_patch_ = is_patch;
        }
        return true;
    }

    // Up to version 4.2: "POLYGONS cells size", then for each cell its number of corners and they;
    // from 5.0: "POLYGONS offsets corners", then an array of each.
    VtkCells read_cells() {
        const std::int64_t first = text_.count("number of cells");
        const std::int64_t second = text_.count("size of the cells");
        VtkCells cells;
        TextReader ahead = text_;
        if (ahead.accept("OFFSETS")) {
            text_ = ahead;
            auto type = expect_type();
            check_room("offsets", first, size_of(type));
            cells.offsets = integers(first, type);
            if (!text_.accept("CONNECTIVITY")) {
                text_.fail("CONNECTIVITY was expected, not " + quoted(text_.word()));
            }
            type = expect_type();
            check_room("corners", second, size_of(type));
            cells.corners = integers(second, type);
            return cells;
        }
        check_room("numbers of cells", second, size_of(NumberType::Int32));
        unpack(first, integers(second, NumberType::Int32), cells);
        return cells;
    }

    void unpack(std::int64_t count, const std::vector<std::int64_t>& packed, VtkCells& cells) {
        cells.offsets.push_back(0);
        auto at = packed.begin();
        for (std::int64_t i = 0; i < count; ++i) {
            if (at == packed.end() || *at < 0 || *at > packed.end() - at - 1) {
                text_.fail("cell " + grouped(i + 1) + " of " + grouped(count) +
                           (at == packed.end()
                                ? " is missing"
                                : " says " + grouped(*at) + " corners, which aren't there"));
            }
            cells.corners.insert(cells.corners.end(), at + 1, at + 1 + *at);
            cells.offsets.push_back(static_cast<std::int64_t>(cells.corners.size()));
            at += 1 + *at;
        }
    }

    NumberType expect_type() {
        const std::string_view word = text_.word();
        const auto type = number_type(word);
        if (!type) {
            text_.fail(quoted(word) + " isn't a type of number");
        }
        return *type;
    }

    // Whether `count` items of `size` bytes can be there; a number in text has at least two.
    void check_room(const std::string& what, std::int64_t count, std::size_t size) {
        const std::size_t least = is_binary_ ? size : 2;
        const std::size_t left = text_.remaining().size() + 1;
        if (count > static_cast<std::int64_t>(left / least)) {
            text_.fail("the file says " + grouped(count) + " " + what + " but only " +
                       grouped(left - 1) + " bytes are left");
        }
    }

    // The bytes of a binary array, which begins after the end of its header's line.
    std::string_view take(std::int64_t count, NumberType type) {
        text_.next_line();
        const std::string_view rest = text_.remaining();
        if (count > static_cast<std::int64_t>(rest.size() / size_of(type))) {
            text_.fail("the file says " + grouped(count) + " numbers but only " +
                       grouped(rest.size()) + " bytes are left");
        }
        const std::size_t size = static_cast<std::size_t>(count) * size_of(type);
        text_.skip(size);
        return rest.substr(0, size);
    }

    std::vector<double> reals(std::int64_t count, NumberType type) {
        if (is_binary_) {
            return to_doubles(take(count, type), type, must_swap(std::endian::big));
        }
        std::vector<double> values(static_cast<std::size_t>(count));
        std::generate(values.begin(), values.end(), [&] { return text_.number(); });
        return values;
    }

    std::vector<std::int64_t> integers(std::int64_t count, NumberType type) {
        if (is_binary_) {
            return to_integers(take(count, type), type, must_swap(std::endian::big));
        }
        std::vector<std::int64_t> values(static_cast<std::size_t>(count));
        std::generate(values.begin(), values.end(), [&] { return text_.integer(); });
        return values;
    }

    bool skip_array(std::int64_t tuples, std::int64_t components, NumberType type) {
        const auto most = static_cast<std::int64_t>(text_.remaining().size() + 1);
        if (components > 0 && tuples > most / components) {
            text_.fail("the file says " + grouped(tuples) + " tuples of " + grouped(components) +
                       " numbers but only " + grouped(most - 1) + " bytes are left");
        }
        if (is_binary_) {
            take(tuples * components, type);
            return true;
        }
        for (std::int64_t i = 0; i < tuples * components; ++i) {
            text_.number();
        }
        return true;
    }

    TextReader text_;
    SurfaceBuilder builder_;
    VtkPiece piece_{};
    std::string_view size_field_;
    std::vector<double> sizes_{};
    std::vector<std::int64_t> labels_{};
    bool has_patch_ = false;
    bool is_binary_ = false;
    bool in_cell_data_ = false;
    std::int64_t tuples_ = 0;
};

}  // namespace

ReadResult read_vtk(std::string_view bytes, const ReadLimits& limits, std::string_view size_field) {
    return VtkReader(bytes, limits, size_field).read();
}

}  // namespace remesh::io

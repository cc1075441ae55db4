#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/base64.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"
#include "core/io/xml.h"

namespace remesh::io {
namespace {

constexpr const char* kName = "GIfTI";

// A DataArray of three columns.
class Table {
public:
    Table(const pugi::xml_node& node, InflateBudget& budget) : node_(node), budget_(budget) {
        rows_ = count_attribute(node, "Dim0", kName, 0);
        if (count_attribute(node, "Dimensionality", kName, 2) != 2 ||
            count_attribute(node, "Dim1", kName, 0) != 3 ||
            rows_ > std::numeric_limits<Index>::max()) {
            throw Error(ErrorCode::InvalidInput,
                        what() + " must have 2 dimensions, the second of them 3");
        }
        is_columns_first_ = attribute("ArrayIndexingOrder") == "ColumnMajorOrder";
    }

    [[nodiscard]] std::int64_t rows() const { return rows_; }
    [[nodiscard]] std::vector<double> reals() const {
        if (attribute("Encoding") != "ASCII") {
            return to_doubles(bytes(), type(), swap());
        }
        std::vector<double> values;
        for (TextReader text(data(), what()); text.skip_space();) {
            values.push_back(text.number());
        }
        return checked(std::move(values));
    }
    [[nodiscard]] std::vector<std::int64_t> integers() const {
        if (attribute("Encoding") != "ASCII") {
            return to_integers(bytes(), type(), swap());
        }
        std::vector<std::int64_t> values;
        for (TextReader text(data(), what()); text.skip_space();) {
            values.push_back(text.integer());
        }
        return checked(std::move(values));
    }
    /// Where the entry of a row and a column stands among the values.
    [[nodiscard]] std::size_t at(std::int64_t row, std::int64_t column) const {
        return static_cast<std::size_t>(is_columns_first_ ? column * rows_ + row
                                                          : 3 * row + column);
    }

private:
    [[nodiscard]] std::string_view attribute(const char* name) const {
        return node_.attribute(name).value();
    }
    [[nodiscard]] std::string what() const {
        return std::string(kName) + ": array " + quoted(attribute("Intent"));
    }
    [[nodiscard]] const char* data() const { return node_.child("Data").child_value(); }
    [[nodiscard]] bool swap() const {
        return must_swap(attribute("Endian") == "BigEndian" ? std::endian::big
                                                            : std::endian::little);
    }

    [[nodiscard]] NumberType type() const {
        const std::string_view name = attribute("DataType");
        if (name == "NIFTI_TYPE_FLOAT32") {
            return NumberType::Float32;
        }
        if (name == "NIFTI_TYPE_FLOAT64") {
            return NumberType::Float64;
        }
        if (name == "NIFTI_TYPE_INT32") {
            return NumberType::Int32;
        }
        if (name == "NIFTI_TYPE_UINT32") {
            return NumberType::UInt32;
        }
        throw Error(ErrorCode::Unsupported, what() + " has the type " + quoted(name) +
                                                "; 32-bit integers and floats are read");
    }

    [[nodiscard]] std::string bytes() const {
        const std::string_view encoding = attribute("Encoding");
        const auto size = static_cast<std::uint64_t>(3 * rows_) * size_of(type());
        std::string bytes;
        if (encoding == "GZipBase64Binary") {
            inflate_block(decode_base64(data()), size, budget_, what(), bytes);
        } else if (encoding == "Base64Binary") {
            bytes = decode_base64(data());
        } else if (encoding == "ExternalFileBinary") {
            throw Error(ErrorCode::Unsupported,
                        what() + " is in another file; give one file that holds everything");
        } else {
            throw Error(ErrorCode::InvalidInput,
                        what() + " has the unknown encoding " + quoted(encoding));
        }
        if (bytes.size() != size) {
            throw Error(ErrorCode::InvalidInput, what() + " says " + grouped(rows_) +
                                                     " rows but holds " + grouped(bytes.size()) +
                                                     " bytes");
        }
        return bytes;
    }

    template <typename T>
    [[nodiscard]] std::vector<T> checked(std::vector<T> values) const {
        if (static_cast<std::int64_t>(values.size()) != 3 * rows_) {
            throw Error(ErrorCode::InvalidInput, what() + " says " + grouped(rows_) +
                                                     " rows but holds " + grouped(values.size()) +
                                                     " values");
        }
        return values;
    }

    pugi::xml_node node_;
    InflateBudget& budget_;
    std::int64_t rows_ = 0;
    bool is_columns_first_ = false;
};

pugi::xml_node array_with(const pugi::xml_node& root, const char* intent) {
    const auto array = root.find_child_by_attribute("DataArray", "Intent", intent);
    if (!array) {
        throw Error(ErrorCode::InvalidInput,
                    std::string("GIfTI: there's no array with the intent ") + intent +
                        ": the file holds no surface");
    }
    return array;
}

}  // namespace

ReadResult read_gifti(std::string_view bytes, const ReadLimits& limits, InflateBudget& budget) {
    pugi::xml_document document;
    parse_xml(bytes, kName, document);
    const auto root = document.child("GIFTI");
    const Table points(array_with(root, "NIFTI_INTENT_POINTSET"), budget);
    const Table triangles(array_with(root, "NIFTI_INTENT_TRIANGLE"), budget);

    SurfaceBuilder builder(MeshFormat::Gifti, kName, limits);
    const std::vector<double> x = points.reals();
    for (std::int64_t i = 0; i < points.rows(); ++i) {
        builder.add_vertex({x[points.at(i, 0)], x[points.at(i, 1)], x[points.at(i, 2)]});
    }
    const std::vector<std::int64_t> v = triangles.integers();
    for (std::int64_t i = 0; i < triangles.rows(); ++i) {
        builder.add_face(
            std::array{v[triangles.at(i, 0)], v[triangles.at(i, 1)], v[triangles.at(i, 2)]});
    }
    return builder.finish();
}

}  // namespace remesh::io

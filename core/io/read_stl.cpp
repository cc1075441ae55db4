#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <vector>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

constexpr std::size_t kHeaderSize = 84;    // 80 free bytes and the number of triangles.
constexpr std::size_t kTriangleSize = 50;  // Normal, three corners, two free bytes.
constexpr bool kSwap = must_swap(std::endian::little);

std::int64_t declared_triangles(std::string_view bytes) {
    return load<std::uint32_t>(bytes.data() + kHeaderSize - 4, kSwap);
}

void check_binary_size(std::string_view bytes, SurfaceBuilder& builder) {
    if (bytes.size() < kHeaderSize) {
        throw Error(ErrorCode::InvalidInput, "STL: the file has only " + grouped(bytes.size()) +
                                                 " bytes, fewer than the header of a binary STL");
    }
    const std::int64_t declared = declared_triangles(bytes);
    const std::size_t data = bytes.size() - kHeaderSize;
    const auto held = static_cast<std::int64_t>(data / kTriangleSize);
    const std::size_t left_over = data % kTriangleSize;
    if (declared != held) {
        throw Error(ErrorCode::InvalidInput,
                    "STL says " + grouped(declared) + " triangles but holds " + grouped(held) +
                        (left_over != 0 ? " and " + grouped(left_over) + " bytes more" : ""));
    }
    if (left_over != 0) {
        builder.warn(grouped(left_over) + " bytes after the last triangle were ignored");
    }
}

ReadResult read_binary(std::string_view bytes, const ReadLimits& limits) {
    SurfaceBuilder builder(MeshFormat::Stl, "STL", limits);
    check_binary_size(bytes, builder);
    const std::int64_t triangles = declared_triangles(bytes);
    builder.reserve(3 * std::min(triangles, limits.max_triangles), triangles);
    const char* at = bytes.data() + kHeaderSize;
    for (std::int64_t t = 0; t < triangles; ++t, at += kTriangleSize) {
        const char* corner = at + 12;
        for (int i = 0; i < 3; ++i, corner += 12) {
            builder.add_vertex({load<float>(corner, kSwap), load<float>(corner + 4, kSwap),
                                load<float>(corner + 8, kSwap)});
        }
        builder.add_face(std::array{3 * t, 3 * t + 1, 3 * t + 2});
    }
    return builder.finish();
}

class AsciiReader {
public:
    AsciiReader(std::string_view bytes, const ReadLimits& limits)
        : text_(bytes, "STL"), builder_(MeshFormat::Stl, "STL", limits) {
        // A triangle takes no fewer bytes than its keywords and 9 digits.
        const auto most = static_cast<std::int64_t>(bytes.size() / 200);
        builder_.reserve(3 * most, most);
    }

    ReadResult read() {
        while (text_.skip_space()) {
            if (text_.accept("facet")) {
                read_facet();
            } else if (text_.accept("solid")) {
                begin_solid();
            } else if (text_.accept("endsolid")) {
                text_.rest_of_line();
                in_solid_ = false;
            } else {
                text_.fail("'facet' or 'endsolid' was expected, not " + quoted(text_.word()));
            }
        }
        if (in_solid_) {
            // Refused, since half a surface would go on as if it were the whole.
            text_.fail("the last solid has no 'endsolid': the file was cut off after " +
                       counted(builder_.triangle_count(), "triangle"));
        }
        return builder_.finish();
    }

private:
    void begin_solid() {
        const std::string_view name = text_.rest_of_line();
        ++solids_;
        builder_.begin_patch(name.empty() ? "solid " + std::to_string(solids_) : std::string(name));
        in_solid_ = true;
    }

    void expect(std::string_view keyword) {
        if (!text_.accept(keyword)) {
            const std::string_view found = text_.word();
            text_.fail(found.empty()
                           ? "the file ends inside a facet"
                           : "'" + std::string(keyword) + "' was expected, not " + quoted(found));
        }
    }

    void read_facet() {
        expect("normal");
        for (int i = 0; i < 3; ++i) {
            text_.word();  // Whatever it says, it isn't used.
        }
        expect("outer");
        expect("loop");
        corners_.clear();
        while (!text_.accept("endloop")) {
            expect("vertex");
            const double x = text_.number();
            const double y = text_.number();
            const double z = text_.number();
            corners_.push_back(builder_.vertex_count());
            builder_.add_vertex({x, y, z});
        }
        expect("endfacet");
        builder_.add_face(corners_);
    }

    TextReader text_;
    SurfaceBuilder builder_;
    std::vector<std::int64_t> corners_{};
    std::int64_t solids_ = 0;
    bool in_solid_ = false;
};

// Many binary files start with "solid", too: what follows tells. Text has no zero bytes.
bool is_ascii(std::string_view bytes) {
    constexpr std::size_t kEnough = 512;
    std::string_view text = trimmed(bytes.substr(0, kEnough));
    return text.size() >= 5 && same_word(text.substr(0, 5), "solid") &&
           text.find('\0') == std::string_view::npos;
}

}  // namespace

bool has_exact_binary_stl_size(std::string_view bytes) {
    return bytes.size() > kHeaderSize && (bytes.size() - kHeaderSize) % kTriangleSize == 0 &&
           static_cast<std::int64_t>((bytes.size() - kHeaderSize) / kTriangleSize) ==
               declared_triangles(bytes);
}

ReadResult read_stl(std::string_view bytes, const ReadLimits& limits) {
    if (!has_exact_binary_stl_size(bytes) && is_ascii(bytes)) {
        return AsciiReader(bytes, limits).read();
    }
    return read_binary(bytes, limits);
}

}  // namespace remesh::io

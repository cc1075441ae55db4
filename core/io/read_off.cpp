#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

class OffReader {
public:
    OffReader(std::string_view bytes, const ReadLimits& limits)
        : text_(bytes, "OFF", '#'), builder_(MeshFormat::Off, "OFF", limits) {}

    ReadResult read() {
        read_header();
        const std::int64_t vertices = text_.count("number of vertices");
        const std::int64_t faces = text_.count("number of faces");
        text_.next_line();  // The number of edges, which nobody needs.
        // "0 0 0" and "3 0 1 2" with their line ends are the shortest there are.
        const auto bytes = static_cast<std::int64_t>(text_.remaining().size());
        builder_.reserve(std::min(vertices, bytes / 6), std::min(faces, bytes / 8));
        read_vertices(vertices);
        read_faces(faces);
        if (text_.skip_space()) {
            builder_.warn("what follows the last face was ignored");
        }
        return builder_.finish();
    }

private:
    // [ST][C][N][4][n]OFF [BINARY]; some programs leave the line out.
    void read_header() {
        TextReader ahead = text_;
        const std::string_view keyword = ahead.word();
        if (!keyword.ends_with("OFF")) {
            return;
        }
        if (keyword.find_first_of("4n") != std::string_view::npos) {
            throw Error(ErrorCode::Unsupported,
                        "OFF: points in other than 3 dimensions (" + quoted(keyword) + ")");
        }
        text_.word();
        if (text_.accept("BINARY")) {
            throw Error(ErrorCode::Unsupported, "OFF: the binary variant isn't read, give ASCII");
        }
    }

    void read_vertices(std::int64_t vertices) {
        for (std::int64_t i = 0; i < vertices; ++i) {
            require_more(vertices, i, "vertices");
            const double x = text_.number();
            const double y = text_.number();
            const double z = text_.number();
            builder_.add_vertex({x, y, z});
            text_.next_line();  // Past normals, colours and texture coordinates.
        }
    }

    void read_faces(std::int64_t faces) {
        for (std::int64_t i = 0; i < faces; ++i) {
            require_more(faces, i, "faces");
            const std::int64_t corners = text_.count("number of corners");
            if (corners > static_cast<std::int64_t>(text_.remaining().size() / 2 + 1)) {
                text_.fail("face " + grouped(i + 1) + " says " + grouped(corners) +
                           " corners, more than the rest of the file holds");
            }
            corners_.clear();
            for (std::int64_t k = 0; k < corners; ++k) {
                corners_.push_back(text_.integer());
                if (corners_.back() < 0 || corners_.back() >= builder_.vertex_count()) {
                    text_.fail("face " + grouped(i + 1) + " refers to vertex " +
                               grouped(corners_.back()) + ", but there are " +
                               grouped(builder_.vertex_count()) + " vertices, counted from 0");
                }
            }
            builder_.add_face(corners_);
            text_.next_line();  // Past a colour.
        }
    }

    void require_more(std::int64_t declared, std::int64_t held, const std::string& what) {
        if (!text_.skip_space()) {
            throw Error(ErrorCode::InvalidInput, "OFF says " + grouped(declared) + " " + what +
                                                     " but holds " + grouped(held));
        }
    }

    TextReader text_;
    SurfaceBuilder builder_;
    std::vector<std::int64_t> corners_{};
};

}  // namespace

ReadResult read_off(std::string_view bytes, const ReadLimits& limits) {
    return OffReader(bytes, limits).read();
}

}  // namespace remesh::io

#include <charconv>
#include <vector>

#include "core/io/numbers.h"
#include "core/io/readers.h"
#include "core/io/surface_builder.h"
#include "core/io/text_reader.h"

namespace remesh::io {
namespace {

class ObjReader {
public:
    ObjReader(std::string_view bytes, const ReadLimits& limits)
        : text_(bytes, "OBJ", '#'), builder_(MeshFormat::Obj, "OBJ", limits) {}

    ReadResult read() {
        while (text_.skip_space()) {
            read_statement();
        }
        if (builder_.triangle_count() == 0 && lines_ > 0) {
            text_.fail("the file holds " + counted(lines_, "line") + " but no faces");
        }
        return builder_.finish();
    }

private:
    void read_statement() {
        const std::string_view keyword = text_.word();
        if (keyword == "v") {
            const double x = text_.number();
            const double y = text_.number();
            const double z = text_.number();
            builder_.add_vertex({x, y, z});
        } else if (keyword == "f") {
            read_face();
        } else if (keyword == "g" || keyword == "o") {
            begin_group();
            return;
        } else if (keyword == "l") {
            ++lines_;
        }
        text_.next_line();  // Normals, texture coordinates, materials: not ours.
    }

    void begin_group() {
        const std::string_view name = text_.skip_blanks() ? text_.rest_of_line() : "";
        builder_.begin_patch(name.empty() ? "default" : name);
    }

    void read_face() {
        corners_.clear();
        while (text_.skip_blanks()) {
            if (text_.remaining().starts_with("\\")) {  // The face goes on in the next line.
                text_.next_line();
            } else {
                corners_.push_back(corner());
            }
        }
        builder_.add_face(corners_);
    }

    // "7", "7/2", "7/2/3" or "7//3", where 7 counts from 1 and -1 is the latest vertex.
    std::int64_t corner() {
        const std::string_view text = text_.word();
        std::int64_t index = 0;
        const auto result = std::from_chars(text.data(), text.data() + text.size(), index);
        const bool is_whole = result.ptr == text.data() + text.size();
        if (result.ec != std::errc{} || (!is_whole && *result.ptr != '/')) {
            text_.fail(quoted(text) + " isn't a corner of a face");
        }
        if (index == 0) {
            text_.fail("a face refers to vertex 0, but OBJ counts from 1");
        }
        if (index < -builder_.vertex_count()) {
            text_.fail("a face refers to vertex " + grouped(index) +
                       " from the end, but there are " + grouped(builder_.vertex_count()) +
                       " so far");
        }
        return index > 0 ? index - 1 : builder_.vertex_count() + index;
    }

    TextReader text_;
    SurfaceBuilder builder_;
    std::vector<std::int64_t> corners_{};
    std::int64_t lines_ = 0;
};

}  // namespace

ReadResult read_obj(std::string_view bytes, const ReadLimits& limits) {
    return ObjReader(bytes, limits).read();
}

}  // namespace remesh::io

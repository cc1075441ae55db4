#include "core/image/plain_image.h"

#include <algorithm>

#include "core/error.h"
#include "core/io/inflate.h"
#include "core/io/numbers.h"
#include "core/io/text_reader.h"

namespace remesh::image {
namespace {

constexpr std::size_t kMaxHeader = 1 << 16;

}  // namespace

std::uint64_t checked_bytes(const PlainImage& plain, std::uint64_t bytes_per_voxel,
                            std::string_view format, const ImageLimits& limits) {
    std::uint64_t voxels = 1;
    for (const std::int64_t n : plain.size) {
        if (n < 2 || n > std::int64_t{1} << 30U) {
            throw Error(ErrorCode::InvalidInput,
                        std::string(format) +
                            ": a size image has three dimensions of at least 2 "
                            "voxels each, got " +
                            std::to_string(n));
        }
        voxels = std::min(voxels * static_cast<std::uint64_t>(n), std::uint64_t{1} << 32U);
    }
    if (voxels > limits.max_voxels || voxels * bytes_per_voxel > limits.max_bytes) {
        throw Error(ErrorCode::TooLarge, std::string(format) + ": a size image has at most " +
                                             io::grouped(limits.max_voxels) + " voxels and " +
                                             io::grouped(limits.max_bytes) +
                                             " bytes of them; resample it");
    }
    return voxels * bytes_per_voxel;
}

void take_voxels(PlainImage& plain, std::string_view rest, bool is_compressed, std::uint64_t bytes,
                 std::string_view format, std::size_t file_size) {
    if (is_compressed) {
        io::InflateBudget budget(
            file_size, {.max_bytes = bytes, .max_expansion = static_cast<double>(io::kBestRatio)});
        io::inflate_block(rest, bytes, budget, std::string(format) + ": the voxels",
                          plain.inflated);
        plain.voxels = {};
        return;
    }
    if (rest.size() < bytes) {
        throw Error(ErrorCode::InvalidInput, std::string(format) + " says " + io::grouped(bytes) +
                                                 " bytes of voxels but holds " +
                                                 io::grouped(rest.size()));
    }
    plain.voxels = rest.substr(0, bytes);
}

std::string_view for_each_line(std::string_view bytes, std::string_view format,
                               const std::function<bool(std::string_view)>& line) {
    std::size_t from = 0;
    while (true) {
        const std::size_t end = bytes.substr(0, kMaxHeader).find('\n', from);
        if (end == std::string_view::npos) {
            throw Error(ErrorCode::InvalidInput, std::string(format) +
                                                     ": the header doesn't end within " +
                                                     io::grouped(kMaxHeader) + " bytes");
        }
        const std::string_view text = io::trimmed(bytes.substr(from, end - from));
        const bool is_printable = std::all_of(text.begin(), text.end(), [](char c) {
            return c == '\t' || (c >= ' ' && c != '\x7f');
        });
        from = end + 1;
        // Comments may be in any language; nothing else may.
        if (!is_printable && !text.starts_with('#') && text.find(":=") == std::string_view::npos) {
            throw Error(ErrorCode::InvalidInput,
                        std::string(format) + ": the header isn't text: " + io::quoted(text));
        }
        if (!line(text)) {
            return bytes.substr(from);
        }
    }
}

std::array<std::int64_t, 3> three_counts(std::string_view text, const std::string& what) {
    io::TextReader reader(text, what);
    std::array<std::int64_t, 3> counts{};
    for (std::int64_t& count : counts) {
        count = reader.count("number of voxels");
    }
    if (reader.skip_space()) {
        throw Error(ErrorCode::Unsupported,
                    what + " must be three numbers, got " + io::quoted(text));
    }
    return counts;
}

}  // namespace remesh::image

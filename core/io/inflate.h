#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/io/mesh_io.h"

namespace remesh::io {

/// What decoding one file may yield in all. A small file can't be blown up by nesting compression
/// or by naming the same bytes many times over, since every decoded byte is charged here.
class InflateBudget {
public:
    InflateBudget(std::size_t file_size, const ReadLimits& limits);

    [[nodiscard]] std::uint64_t left() const { return left_; }
    /// \throws Error{TooLarge} if fewer than `bytes` are left
    void charge(std::uint64_t bytes);

private:
    std::uint64_t allowed_;
    std::uint64_t left_;
};

[[nodiscard]] bool is_gzip(std::string_view bytes);

/// All members of a gzip file, one after another.
/// \throws Error{InvalidInput} if it's damaged or ends early, Error{TooLarge} beyond the budget
[[nodiscard]] std::string gunzip(std::string_view bytes, InflateBudget& budget);

/// The first `size` bytes of what a gzip file holds, or fewer. Never throws for damaged data.
[[nodiscard]] std::string gunzip_head(std::string_view bytes, std::size_t size);

/// What deflate can do at best: bytes for each compressed one.
inline constexpr std::uint64_t kBestRatio = 1032;

/// To be asked before memory is taken for what a file says it holds.
/// \param what  names what holds the compressed bytes, e.g. "VTP: array 'Points'"
/// \throws Error{InvalidInput} if so many compressed bytes can't hold `size`
void require_can_hold(std::size_t compressed, std::uint64_t size, const std::string& what);

/// Inflates one zlib or gzip stream that must yield exactly `size` bytes, and appends them.
/// \param what  names the array in errors, e.g. "VTP: array 'Points'"
/// \throws Error{InvalidInput} if it doesn't, Error{TooLarge} beyond the budget
void inflate_block(std::string_view compressed, std::uint64_t size, InflateBudget& budget,
                   const std::string& what, std::string& out);

}  // namespace remesh::io

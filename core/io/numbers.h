#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace remesh::io {

/// How a file stores the numbers of an array.
enum class NumberType {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64
};

[[nodiscard]] std::size_t size_of(NumberType type);
[[nodiscard]] bool is_integer(NumberType type);

/// Whether numbers stored in this byte order must be swapped on this machine.
[[nodiscard]] constexpr bool must_swap(std::endian stored) {
    return stored != std::endian::native;
}

template <typename T>
T byte_swapped(T value) {
    if constexpr (sizeof(T) == 1) {
        return value;
    } else if constexpr (sizeof(T) == 2) {
        return std::bit_cast<T>(__builtin_bswap16(std::bit_cast<std::uint16_t>(value)));
    } else if constexpr (sizeof(T) == 4) {
        return std::bit_cast<T>(__builtin_bswap32(std::bit_cast<std::uint32_t>(value)));
    } else {
        return std::bit_cast<T>(__builtin_bswap64(std::bit_cast<std::uint64_t>(value)));
    }
}

/// Reads a number from any address; the caller knows that sizeof(T) bytes are there.
template <typename T>
T load(const char* bytes, bool swap) {
    T value{};
    std::memcpy(&value, bytes, sizeof(T));
    return swap ? byte_swapped(value) : value;
}

/// Calls `visit` with a value of the C++ type that `type` names (its argument's type is all that
/// matters), so that a loop over an array chooses its type once.
template <typename Visit>
auto with_type(NumberType type, Visit visit) {
    switch (type) {
        case NumberType::Int8: return visit(std::int8_t{});
        case NumberType::UInt8: return visit(std::uint8_t{});
        case NumberType::Int16: return visit(std::int16_t{});
        case NumberType::UInt16: return visit(std::uint16_t{});
        case NumberType::Int32: return visit(std::int32_t{});
        case NumberType::UInt32: return visit(std::uint32_t{});
        case NumberType::Int64: return visit(std::int64_t{});
        case NumberType::UInt64: return visit(std::uint64_t{});
        case NumberType::Float32: return visit(float{});
        case NumberType::Float64: break;
    }
    return visit(double{});
}

[[nodiscard]] double load_double(const char* bytes, NumberType type, bool swap);

/// \throws Error{InvalidInput} for a floating value that isn't a whole number below 2^53
[[nodiscard]] std::int64_t load_integer(const char* bytes, NumberType type, bool swap);

/// All numbers of an array; bytes beyond the last whole number are left out.
[[nodiscard]] std::vector<double> to_doubles(std::string_view bytes, NumberType type, bool swap);
[[nodiscard]] std::vector<std::int64_t> to_integers(std::string_view bytes, NumberType type,
                                                    bool swap);

/// 4000000 as "4,000,000", for people.
[[nodiscard]] std::string grouped(std::int64_t number);
[[nodiscard]] std::string grouped(std::size_t number);

/// "1 triangle", "4,000 triangles".
[[nodiscard]] std::string counted(std::int64_t number, std::string_view noun);

}  // namespace remesh::io

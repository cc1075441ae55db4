#include "core/io/numbers.h"

#include <cmath>

#include "core/error.h"
#include "core/number_text.h"

namespace remesh::io {
namespace {

template <typename T>
std::int64_t to_integer(T value) {
    if constexpr (std::is_floating_point_v<T>) {
        // The comparison is false for NaN, too; casting either would be undefined.
        constexpr double kExact = 9007199254740992.0;
        if (!(std::abs(static_cast<double>(value)) < kExact) || std::trunc(value) != value) {
            throw Error(ErrorCode::InvalidInput,
                        "an array of whole numbers holds " + number_text(value));
        }
    }
    return static_cast<std::int64_t>(value);
}

template <typename Out, typename Convert>
std::vector<Out> convert_all(std::string_view bytes, NumberType type, Convert convert) {
    const std::size_t size = size_of(type);
    std::vector<Out> values(bytes.size() / size);
    with_type(type, [&](auto kind) {
        for (std::size_t i = 0; i < values.size(); ++i) {
            values[i] = convert(kind, bytes.data() + i * size);
        }
    });
    return values;
}

}  // namespace

std::size_t size_of(NumberType type) {
    return with_type(type, [](auto kind) { return sizeof(kind); });
}

bool is_integer(NumberType type) {
    return type != NumberType::Float32 && type != NumberType::Float64;
}

double load_double(const char* bytes, NumberType type, bool swap) {
    return with_type(
        type, [&](auto kind) { return static_cast<double>(load<decltype(kind)>(bytes, swap)); });
}

std::int64_t load_integer(const char* bytes, NumberType type, bool swap) {
    return with_type(type,
                     [&](auto kind) { return to_integer(load<decltype(kind)>(bytes, swap)); });
}

std::vector<double> to_doubles(std::string_view bytes, NumberType type, bool swap) {
    return convert_all<double>(bytes, type, [swap](auto kind, const char* at) {
        return static_cast<double>(load<decltype(kind)>(at, swap));
    });
}

std::vector<std::int64_t> to_integers(std::string_view bytes, NumberType type, bool swap) {
    return convert_all<std::int64_t>(bytes, type, [swap](auto kind, const char* at) {
        return to_integer(load<decltype(kind)>(at, swap));
    });
}

std::string grouped(std::int64_t number) {
    std::string digits = std::to_string(number);
    const std::size_t sign = number < 0 ? 1 : 0;
    for (std::size_t i = digits.size(); i > 3 + sign; i -= 3) {
        digits.insert(i - 3, ",");
    }
    return digits;
}

std::string grouped(std::size_t number) {
    return grouped(static_cast<std::int64_t>(number));
}

std::string counted(std::int64_t number, std::string_view noun) {
    return grouped(number) + " " + std::string(noun) + (number == 1 ? "" : "s");
}

}  // namespace remesh::io

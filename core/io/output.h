#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ostream>
#include <string_view>
#include <vector>

#include "core/io/numbers.h"
#include "core/mesh/mesh.h"

namespace remesh::io {

/// Gathers what a writer makes and passes it on in large blocks. Everything is out once it's
/// destroyed or flush() was called.
class Output {
public:
    explicit Output(std::ostream& out) : out_(out), buffer_(kSize) {}
    ~Output() { flush(); }
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    Output& operator<<(std::string_view text) {
        write(text.data(), text.size());
        return *this;
    }
    Output& operator<<(char c) {
        reserve(1);
        buffer_[used_++] = c;
        return *this;
    }
    /// The shortest text that reads as the same number again.
    Output& operator<<(double value) { return number(value); }
    Output& operator<<(std::int32_t value) { return number(value); }
    Output& operator<<(std::int64_t value) { return number(value); }
    Output& operator<<(std::size_t value) { return number(value); }
    /// Three coordinates with blanks between them.
    Output& operator<<(const Vec3& v) { return *this << v.x() << ' ' << v.y() << ' ' << v.z(); }

    void write(const char* bytes, std::size_t size) {
        if (size > kSize - used_) {
            flush();
        }
        if (size > kSize) {
            out_.write(bytes, static_cast<std::streamsize>(size));
            return;
        }
        std::copy(bytes, bytes + size, buffer_.data() + used_);
        used_ += size;
    }

    /// A number as it stands in memory, byte-swapped if the format wants it.
    template <typename T>
    void put(T value, bool swap) {
        const T stored = swap ? byte_swapped(value) : value;
        reserve(sizeof(T));
        std::memcpy(buffer_.data() + used_, &stored, sizeof(T));
        used_ += sizeof(T);
    }

    void flush() {
        out_.write(buffer_.data(), static_cast<std::streamsize>(used_));
        used_ = 0;
    }

private:
    static constexpr std::size_t kSize = std::size_t{1} << 18;
    static constexpr std::size_t kLongestNumber = 32;

    void reserve(std::size_t size) {
        if (size > kSize - used_) {
            flush();
        }
    }

    template <typename T>
    Output& number(T value) {
        reserve(kLongestNumber);
        char* at = buffer_.data() + used_;
        used_ = static_cast<std::size_t>(std::to_chars(at, at + kLongestNumber, value).ptr -
                                         buffer_.data());
        return *this;
    }

    std::ostream& out_;
    std::vector<char> buffer_;
    std::size_t used_ = 0;
};

}  // namespace remesh::io

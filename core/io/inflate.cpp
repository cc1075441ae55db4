#include "core/io/inflate.h"

#include <algorithm>
#include <limits>
#include <zlib.h>

#include "core/error.h"
#include "core/io/numbers.h"

namespace remesh::io {
namespace {

constexpr int kAutoHeader = 15 + 32;  // Largest window; zlib or gzip, whichever is there.

// A z_stream that's ended when it goes. It reads all of `input`, however large.
class Inflater {
public:
    explicit Inflater(std::string_view input) : input_(input) {
        if (inflateInit2(&stream_, kAutoHeader) != Z_OK) {
            throw Error(ErrorCode::Internal, "zlib can't start to inflate");
        }
    }
    ~Inflater() { inflateEnd(&stream_); }
    Inflater(const Inflater&) = delete;
    Inflater& operator=(const Inflater&) = delete;

    // Inflates up to `size` bytes to `to`; returns how many came. Fewer: see done(), failed().
    std::size_t read(char* to, std::size_t size) {
        std::size_t made = 0;
        while (made < size && status_ == Z_OK) {
            refill();
            const auto chunk = static_cast<uInt>(std::min(size - made, kChunk));
            stream_.next_out = reinterpret_cast<Bytef*>(to + made);
            stream_.avail_out = chunk;
            const bool had_input = stream_.avail_in > 0;
            status_ = inflate(&stream_, Z_NO_FLUSH);
            const std::size_t got = chunk - stream_.avail_out;
            made += got;
            if (status_ == Z_OK && got == 0 && !had_input) {
                status_ = Z_BUF_ERROR;
            }
        }
        return made;
    }

    [[nodiscard]] bool done() const { return status_ == Z_STREAM_END; }
    [[nodiscard]] bool ended_early() const { return status_ == Z_BUF_ERROR; }
    [[nodiscard]] bool failed() const { return status_ != Z_OK && status_ != Z_STREAM_END; }

    // What follows the stream that just ended.
    [[nodiscard]] std::string_view rest() const { return input_.substr(taken_ - stream_.avail_in); }
    void next_member() {
        const std::string_view following = rest();
        inflateReset(&stream_);
        input_ = following;
        taken_ = 0;
        stream_.avail_in = 0;
        status_ = Z_OK;
    }

private:
    static constexpr std::size_t kChunk = std::size_t{1} << 30;

    void refill() {
        if (stream_.avail_in == 0 && taken_ < input_.size()) {
            const std::size_t chunk = std::min(input_.size() - taken_, kChunk);
            // zlib's interface isn't const-correct; it doesn't write to its input.
            stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(input_.data() + taken_));
            stream_.avail_in = static_cast<uInt>(chunk);
            taken_ += chunk;
        }
    }

    z_stream stream_{};
    std::string_view input_;
    std::size_t taken_ = 0;
    int status_ = Z_OK;
};

}  // namespace

InflateBudget::InflateBudget(std::size_t file_size, const ReadLimits& limits) {
    constexpr double kAlwaysAllowed = 1 << 20;
    const double by_ratio =
        std::max(kAlwaysAllowed, static_cast<double>(file_size) * limits.max_expansion);
    allowed_ = by_ratio < static_cast<double>(limits.max_bytes)
                   ? static_cast<std::uint64_t>(by_ratio)
                   : limits.max_bytes;
    left_ = allowed_;
}

void InflateBudget::charge(std::uint64_t bytes) {
    if (bytes > left_) {
        throw Error(ErrorCode::TooLarge, "the file holds more than the " +
                                             grouped(static_cast<std::size_t>(allowed_)) +
                                             " bytes that it may have once decompressed");
    }
    left_ -= bytes;
}

bool is_gzip(std::string_view bytes) {
    return bytes.starts_with("\x1f\x8b");
}

std::string gunzip(std::string_view bytes, InflateBudget& budget) {
    std::string out;
    Inflater inflater(bytes);
    while (true) {
        constexpr std::size_t kLeast = 1 << 16;
        // One byte more than allowed is enough to see that it's too much.
        const std::uint64_t room = std::min<std::uint64_t>(
            std::max({kLeast, 2 * bytes.size(), out.size()}), budget.left() + 1);
        const std::size_t before = out.size();
        out.resize(before + static_cast<std::size_t>(room));
        const std::size_t made = inflater.read(out.data() + before, static_cast<std::size_t>(room));
        out.resize(before + made);
        budget.charge(made);
        if (inflater.failed()) {
            throw Error(ErrorCode::InvalidInput,
                        (inflater.ended_early() ? "gzip: the file ends early, after "
                                                : "gzip: the data is damaged after ") +
                            grouped(out.size()) + " decompressed bytes");
        }
        if (inflater.done()) {
            if (!is_gzip(inflater.rest())) {
                return out;
            }
            inflater.next_member();
        }
    }
}

std::string gunzip_head(std::string_view bytes, std::size_t size) {
    std::string head(size, '\0');
    head.resize(Inflater(bytes).read(head.data(), size));
    return head;
}

void require_can_hold(std::size_t compressed, std::uint64_t size, const std::string& what) {
    if (size / kBestRatio > compressed) {
        throw Error(ErrorCode::InvalidInput,
                    what + " can't hold " + grouped(static_cast<std::size_t>(size)) + " bytes in " +
                        grouped(compressed) + " compressed ones");
    }
}

void inflate_block(std::string_view compressed, std::uint64_t size, InflateBudget& budget,
                   const std::string& what, std::string& out) {
    require_can_hold(compressed.size(), size, what);
    budget.charge(size);
    const std::size_t before = out.size();
    out.resize(before + static_cast<std::size_t>(size));
    Inflater inflater(compressed);
    std::size_t made = inflater.read(out.data() + before, static_cast<std::size_t>(size));
    char extra = 0;
    made += inflater.read(&extra, 1);  // Also takes in the stream's checksum.
    if (made != size || !inflater.done()) {
        throw Error(ErrorCode::InvalidInput,
                    what + " is damaged: its compressed data doesn't give " +
                        grouped(static_cast<std::size_t>(size)) + " bytes");
    }
}

}  // namespace remesh::io

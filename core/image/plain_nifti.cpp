#include <array>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/image/plain_image.h"
#include "core/io/inflate.h"
#include "core/io/numbers.h"

namespace remesh::image {
namespace {

constexpr std::size_t kHeaderBytes = 348;
constexpr std::size_t kSecondVersionBytes = 540;
constexpr std::size_t kDataOffset = 352;  // Of the file that we make.
constexpr std::size_t kMostExtensions = 1 << 24;

// Where the header has what.
constexpr std::size_t kDimensions = 40;    // 8 int16: how many, and the size along each.
constexpr std::size_t kDataType = 70;      // int16
constexpr std::size_t kBits = 72;          // int16
constexpr std::size_t kVoxelOffset = 108;  // float
constexpr std::size_t kMagic = 344;

constexpr std::size_t kSpacing = 76;      // float pixdim[8]
constexpr std::size_t kRowsCode = 254;    // int16 sform_code
constexpr std::size_t kQuaternion = 256;  // 3 float
constexpr std::size_t kOffset = 268;      // 3 float
constexpr std::size_t kRows = 280;        // 3 by 4 float

constexpr float kShortest = 1e-6F;  // Of a voxel, in the unit of the file.
constexpr float kLongest = 1e9F;

int bytes_of_type(int type) {
    switch (type) {
        case 2:               // uint8
        case 256: return 1;   // int8
        case 4:               // int16
        case 512: return 2;   // uint16
        case 8:               // int32
        case 16:              // float
        case 768: return 4;   // uint32
        case 64:              // double
        case 1024:            // int64
        case 1280: return 8;  // uint64
        default:
            throw Error(
                ErrorCode::Unsupported,
                "NIfTI: voxels must be single numbers, got data type " + std::to_string(type));
    }
}

class Header {
public:
    explicit Header(std::string_view bytes) : bytes_(bytes) {
        if (bytes.size() < kDataOffset) {
            throw Error(ErrorCode::InvalidInput, "NIfTI: the header ends early");
        }
        swap_ = io::load<std::int32_t>(bytes.data(), false) != kHeaderBytes;
        const auto size = io::load<std::int32_t>(bytes.data(), swap_);
        if (size == kSecondVersionBytes ||
            io::load<std::int32_t>(bytes.data(), false) == kSecondVersionBytes) {
            throw Error(ErrorCode::Unsupported, "NIfTI-2 isn't read; save it as NIfTI-1");
        }
        const std::string_view magic = bytes.substr(kMagic, 3);
        if (magic == "ni1") {
            throw Error(ErrorCode::Unsupported,
                        "NIfTI: the voxels are in another file (.hdr and .img); save one .nii");
        }
        if (size != kHeaderBytes || magic != "n+1") {
            throw Error(ErrorCode::InvalidInput, "NIfTI: this is no header of a .nii file");
        }
    }

    template <typename T>
    [[nodiscard]] T at(std::size_t offset) const {
        return io::load<T>(bytes_.data() + offset, swap_);
    }
    [[nodiscard]] std::array<std::int64_t, 3> size() const {
        const int dimensions = at<std::int16_t>(kDimensions);
        for (int d = 4; d <= dimensions && d < 8; ++d) {
            const int n = dimension(d);
            if (n > 1) {
                throw Error(ErrorCode::Unsupported,
                            "NIfTI: a size image has three dimensions, this one has " +
                                std::to_string(n) + " along the next");
            }
        }
        if (dimensions < 3 || dimensions > 7) {
            throw Error(ErrorCode::InvalidInput, "NIfTI: a size image has three dimensions, got " +
                                                     std::to_string(dimensions));
        }
        return {dimension(1), dimension(2), dimension(3)};
    }
    [[nodiscard]] std::uint64_t bytes_per_voxel() const {
        const int bytes = bytes_of_type(at<std::int16_t>(kDataType));
        if (at<std::int16_t>(kBits) != 8 * bytes) {
            throw Error(ErrorCode::InvalidInput, "NIfTI: bitpix doesn't fit the data type");
        }
        return static_cast<std::uint64_t>(bytes);
    }
    [[nodiscard]] std::size_t voxel_offset() const {
        const auto offset = static_cast<double>(at<float>(kVoxelOffset));
        // 0 is what some programs write for a .nii without extensions.
        if (!(offset == 0.0 || (offset >= kDataOffset && offset <= kMostExtensions &&
                                offset == std::floor(offset)))) {
            throw Error(
                ErrorCode::InvalidInput,
                "NIfTI: vox_offset must be in [352, 16777216], got " + std::to_string(offset));
        }
        return offset == 0.0 ? kDataOffset : static_cast<std::size_t>(offset);
    }

    /// ITK's matrices abort the process where they aren't finite, also after division by a length.
    void require_good_geometry() const {
        bool is_good = true;
        for (std::size_t d = 0; d < 3; ++d) {
            is_good = is_good && is_length(at<float>(kSpacing + 4 * (d + 1)));
            is_good = is_good && std::abs(at<float>(kQuaternion + 4 * d)) <= 1.0F;
            is_good = is_good && std::abs(at<float>(kOffset + 4 * d)) <= kLongest;
        }
        for (std::size_t i = 0; i < 12; ++i) {
            is_good = is_good && std::abs(at<float>(kRows + 4 * i)) <= kLongest;
        }
        for (std::size_t column = 0; column < 3 && at<std::int16_t>(kRowsCode) != 0; ++column) {
            // Each is finite by now: std::hypot of three doesn't always see one that is not.
            is_good = is_good && is_length(std::hypot(at<float>(kRows + 4 * column),
                                                      at<float>(kRows + 16 + 4 * column),
                                                      at<float>(kRows + 32 + 4 * column)));
        }
        if (!is_good) {
            throw Error(ErrorCode::InvalidInput,
                        "NIfTI: pixdim, qform and sform must be finite numbers that say where the "
                        "voxels are");
        }
    }

    /// The same, for three dimensions and voxels right behind it.
    [[nodiscard]] std::string plain() const {
        std::string header(bytes_.substr(0, kHeaderBytes));
        store<std::int16_t>(header, kDimensions, 3);
        for (std::size_t d = 4; d < 8; ++d) {
            store<std::int16_t>(header, kDimensions + 2 * d, 1);
        }
        store<float>(header, kVoxelOffset, static_cast<float>(kDataOffset));
        header[kMagic + 3] = '\0';
        header.resize(kDataOffset, '\0');  // No extensions.
        return header;
    }

private:
    static bool is_length(float x) { return x >= kShortest && x <= kLongest; }
    [[nodiscard]] std::int16_t dimension(int d) const {
        return at<std::int16_t>(kDimensions + 2 * static_cast<std::size_t>(d));
    }
    template <typename T>
    void store(std::string& header, std::size_t offset, T value) const {
        const T stored = swap_ ? io::byte_swapped(value) : value;
        std::memcpy(header.data() + offset, &stored, sizeof stored);
    }

    std::string_view bytes_;
    bool swap_ = false;
};

}  // namespace

PlainImage plain_nifti(std::string_view bytes, const ImageLimits& limits) {
    const bool is_compressed = io::is_gzip(bytes);
    const std::string head = is_compressed ? io::gunzip_head(bytes, kDataOffset) : std::string();
    const Header header(is_compressed ? std::string_view(head) : bytes);
    PlainImage plain;
    plain.format = ImageFormat::Nifti;
    plain.size = header.size();
    const std::uint64_t size = checked_bytes(plain, header.bytes_per_voxel(), "NIfTI", limits);
    const std::size_t offset = header.voxel_offset();
    header.require_good_geometry();
    plain.header = header.plain();
    if (!is_compressed) {
        take_voxels(plain, bytes.substr(std::min(offset, bytes.size())), false, size, "NIfTI",
                    bytes.size());
        return plain;
    }
    io::require_can_hold(bytes.size(), offset + size, "NIfTI: the file");
    plain.inflated = io::gunzip_head(bytes, offset + size);
    if (plain.inflated.size() < offset + size) {
        throw Error(ErrorCode::InvalidInput, "NIfTI: the file is damaged or ends early, after " +
                                                 io::grouped(plain.inflated.size()) +
                                                 " decompressed bytes of " +
                                                 io::grouped(offset + size));
    }
    plain.inflated.erase(0, offset);
    return plain;
}

}  // namespace remesh::image

// Images of sizes: files to lattices.

#include "core/image/read_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr std::array<std::int16_t, 3> kSize{4, 3, 2};

/// 1, 2, 3, ... in the order of the file.
template <typename T>
std::string counted_voxels(bool swap = false) {
    std::string bytes;
    for (int i = 1; i <= 24; ++i) {
        std::array<char, sizeof(T)> stored{};
        const T value = static_cast<T>(i);
        std::memcpy(stored.data(), &value, sizeof value);
        if (swap) {
            std::reverse(stored.begin(), stored.end());
        }
        bytes.append(stored.data(), stored.size());
    }
    return bytes;
}

/// A header of NIfTI-1, field by field.
class Nifti {
public:
    explicit Nifti(bool swap = false) : swap_(swap) {
        set<std::int32_t>(0, 348);
        set<std::int16_t>(40, 3);
        for (std::size_t d = 0; d < 3; ++d) {
            set<std::int16_t>(42 + 2 * d, kSize[d]);
        }
        for (std::size_t d = 3; d < 7; ++d) {
            set<std::int16_t>(42 + 2 * d, 1);
        }
        type(16, 32);
        set<float>(76, 1.0F);
        for (std::size_t d = 0; d < 3; ++d) {
            set<float>(80 + 4 * d, 1.0F);
        }
        set<float>(108, 352.0F);
        bytes_[123] = 2;  // mm
        std::memcpy(bytes_.data() + 344, "n+1", 4);
    }
    template <typename T>
    Nifti& set(std::size_t offset, T value) {
        std::array<char, sizeof(T)> stored{};
        std::memcpy(stored.data(), &value, sizeof value);
        if (swap_) {
            std::reverse(stored.begin(), stored.end());
        }
        bytes_.replace(offset, sizeof(T), stored.data(), sizeof(T));
        return *this;
    }
    Nifti& type(std::int16_t type, std::int16_t bits) {
        return set<std::int16_t>(70, type).set<std::int16_t>(72, bits);
    }
    /// Rows of the matrix that takes voxels to RAS.
    Nifti& sform(const std::array<std::array<float, 4>, 3>& rows) {
        set<std::int16_t>(254, 1);
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 4; ++c) {
                set<float>(280 + 16 * r + 4 * c, rows[r][c]);
            }
        }
        for (std::size_t c = 0; c < 3; ++c) {
            const float length = std::hypot(rows[0][c], rows[1][c], rows[2][c]);
            set<float>(80 + 4 * c, length);
        }
        return *this;
    }
    [[nodiscard]] std::string with(const std::string& voxels) const { return bytes_ + voxels; }

private:
    bool swap_;
    std::string bytes_ = std::string(352, '\0');
};

std::string nrrd(const std::string& fields, const std::string& voxels) {
    return "NRRD0004\n# made by a test\ntype: float\ndimension: 3\nsizes: 4 3 2\n"
           "endian: little\n" +
           fields + "\n\n" + voxels;
}

std::string meta(const std::string& fields, const std::string& voxels,
                 const std::string& file = "LOCAL") {
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\n"
           "BinaryDataByteOrderMSB = False\n" +
           fields + "DimSize = 4 3 2\nElementType = MET_FLOAT\nElementDataFile = " + file + "\n" +
           voxels;
}

Vec3 voxel_center(const SizeImage& image, double i, double j, double k) {
    return image.origin + image.axes * image.spacing.cwiseProduct(Vec3(i, j, k));
}

void expect_counted(const SizeImage& image) {
    ASSERT_THAT(image.size, ElementsAre(4, 3, 2));
    ASSERT_THAT(image.sizes, SizeIs(24));
    for (std::size_t i = 0; i < 24; ++i) {
        EXPECT_EQ(image.sizes[i], static_cast<float>(i + 1));
    }
}

void expect_near(const Vec3& actual, const Vec3& expected) {
    EXPECT_LT((actual - expected).norm(), 1e-5)
        << actual.transpose() << " instead of " << expected.transpose();
}

std::string refusal_of(const std::string& bytes, ErrorCode code) {
    try {
        static_cast<void>(read_size_image(bytes));
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), code) << error.what();
        return error.what();
    }
    ADD_FAILURE() << "it was read";
    return "";
}

TEST(ReadSizeImage, TakesNiftiFromRasToLps) {
    // Axes turned by 30 degrees around z, spacing 2, 3, 4, origin 10, 20, 30 in RAS.
    const auto c = static_cast<float>(std::cos(std::numbers::pi / 6));
    const auto s = static_cast<float>(std::sin(std::numbers::pi / 6));
    const std::string file =
        Nifti()
            .sform({{{2 * c, -3 * s, 0, 10}, {2 * s, 3 * c, 0, 20}, {0, 0, 4, 30}}})
            .with(counted_voxels<float>());

    const SizeImage image = read_size_image(file);

    expect_counted(image);
    expect_near(image.origin, {-10, -20, 30});
    expect_near(voxel_center(image, 1, 0, 0), {-10 - 2 * c, -20 - 2 * s, 30});
    expect_near(voxel_center(image, 0, 1, 0), {-10 + 3 * s, -20 - 3 * c, 30});
    expect_near(voxel_center(image, 0, 0, 1), {-10, -20, 34});
    EXPECT_TRUE(image.assumes_space);
}

TEST(ReadSizeImage, TakesNiftiToASurfaceInRasAndMetres) {
    const std::string file = Nifti()
                                 .sform({{{1, 0, 0, 10}, {0, 1, 0, 20}, {0, 0, 1, 30}}})
                                 .with(counted_voxels<float>());

    const SizeImage image =
        read_size_image(file, {}, {.space = SurfaceFrame::Space::Ras, .millimeters = 1000.0});

    expect_near(image.origin, {0.010, 0.020, 0.030});
    expect_near(voxel_center(image, 1, 1, 1), {0.011, 0.021, 0.031});
    EXPECT_FLOAT_EQ(image.sizes.back(), 0.024F);
    EXPECT_FALSE(image.assumes_space);
}

TEST(ReadSizeImage, ReadsNiftiOfWholeNumbersInTheOtherByteOrder) {
    const std::string file = Nifti(true).type(4, 16).with(counted_voxels<std::int16_t>(true));

    expect_counted(read_size_image(file));
}

TEST(ReadSizeImage, ReadsGzippedNiftiWithExtensions) {
    Nifti header;
    header.set<float>(108, 368.0F);
    const std::string file = gzipped(header.with(std::string(16, 'x') + counted_voxels<float>()));

    expect_counted(read_size_image(file));
}

TEST(ReadSizeImage, ScalesNiftiBySlopeAndIntercept) {
    Nifti header;
    header.type(2, 8).set<float>(112, 0.5F).set<float>(116, 1.0F);

    const SizeImage image = read_size_image(header.with(counted_voxels<unsigned char>()));

    EXPECT_FLOAT_EQ(image.sizes.front(), 1.5F);
    EXPECT_FLOAT_EQ(image.sizes.back(), 13.0F);
}

TEST(ReadSizeImage, TakesNrrdFromRasToLps) {
    const std::string file = nrrd(
        "space: right-anterior-superior\nspace directions: (2,0,0) (0,0,3) (0,-4,0)\n"
        "space origin: (5,6,7)\nencoding: raw",
        counted_voxels<float>());

    const SizeImage image = read_size_image(file);

    expect_counted(image);
    expect_near(image.origin, {-5, -6, 7});
    expect_near(voxel_center(image, 1, 0, 0), {-7, -6, 7});
    expect_near(voxel_center(image, 0, 1, 0), {-5, -6, 10});
    expect_near(voxel_center(image, 0, 0, 1), {-5, -2, 7});
}

TEST(ReadSizeImage, ReadsGzippedVoxelsOfNrrd) {
    const std::string file =
        nrrd("encoding: gzip\nspacings: 1 1 2", gzipped(counted_voxels<float>()));

    const SizeImage image = read_size_image(file);

    expect_counted(image);
    EXPECT_EQ(image.spacing, Vec3(1, 1, 2));
}

TEST(ReadSizeImage, ReadsMetaImageWithItsDirections) {
    const std::string file =
        meta("TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.5 1 2\n",
             counted_voxels<float>());

    const SizeImage image = read_size_image(file);

    expect_counted(image);
    expect_near(image.origin, {1, 2, 3});
    // The matrix is written axis by axis.
    expect_near(voxel_center(image, 1, 0, 0), {1, 2.5, 3});
    expect_near(voxel_center(image, 0, 1, 0), {0, 2, 3});
    expect_near(voxel_center(image, 0, 0, 1), {1, 2, 5});
}

TEST(ReadSizeImage, ReadsCompressedVoxelsOfMetaImage) {
    const std::string file = meta("CompressedData = True\nCompressedDataSize = 99999999999\n",
                                  deflated(counted_voxels<float>(), 15));

    expect_counted(read_size_image(file));
}

TEST(ReadSizeImage, RefusesHeadersThatNameAnotherFile) {
    const std::string voxels = counted_voxels<float>();
    std::string pair = Nifti().with(voxels);
    pair.replace(344, 3, "ni1");

    EXPECT_THAT(refusal_of(meta("", voxels, "/etc/passwd"), ErrorCode::Unsupported),
                HasSubstr("ElementDataFile must be LOCAL"));
    EXPECT_THAT(refusal_of(meta("", voxels, "LIST"), ErrorCode::Unsupported),
                HasSubstr("ElementDataFile must be LOCAL"));
    EXPECT_THAT(
        refusal_of(nrrd("data file: /etc/passwd\nencoding: raw", voxels), ErrorCode::Unsupported),
        HasSubstr("names another file"));
    EXPECT_THAT(
        refusal_of(nrrd("DATAFILE: /etc/passwd\nencoding: raw", voxels), ErrorCode::Unsupported),
        HasSubstr("names another file"));
    EXPECT_THAT(refusal_of(pair, ErrorCode::Unsupported), HasSubstr("another file"));
}

TEST(ReadSizeImage, RefusesSizesThatTheBytesDoNotHold) {
    const std::string few = counted_voxels<float>().substr(0, 90);

    EXPECT_THAT(refusal_of(Nifti().with(few), ErrorCode::InvalidInput),
                HasSubstr("says 96 bytes of voxels but holds 90"));
    EXPECT_THAT(refusal_of(nrrd("encoding: raw", few), ErrorCode::InvalidInput),
                HasSubstr("holds 90"));
    EXPECT_THAT(refusal_of(meta("", few), ErrorCode::InvalidInput), HasSubstr("holds 90"));
    EXPECT_THAT(refusal_of(gzipped(Nifti().with(few)), ErrorCode::InvalidInput),
                HasSubstr("ends early"));
    EXPECT_THAT(refusal_of(nrrd("encoding: gzip", gzipped(few)), ErrorCode::InvalidInput),
                HasSubstr("damaged"));
}

TEST(ReadSizeImage, RefusesHugeSizesBeforeItTakesMemory) {
    Nifti nifti;
    for (std::size_t d = 0; d < 3; ++d) {
        nifti.set<std::int16_t>(42 + 2 * d, 32767);
    }
    EXPECT_THAT(refusal_of(nifti.with(""), ErrorCode::TooLarge), HasSubstr("134,217,728 voxels"));
    EXPECT_THAT(refusal_of("NRRD0004\ntype: double\ndimension: 3\nencoding: raw\n"
                           "sizes: 1000000000 1000000000 1000000000\nendian: little\n\n",
                           ErrorCode::TooLarge),
                HasSubstr("resample"));
    EXPECT_THAT(refusal_of("ObjectType = Image\nNDims = 3\nDimSize = 600 600 600\n"
                           "ElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
                           ErrorCode::TooLarge),
                HasSubstr("resample"));
}

TEST(ReadSizeImage, RefusesWhatIsNoVolumeOfNumbers) {
    const std::string voxels = counted_voxels<float>();
    Nifti series;
    series.set<std::int16_t>(40, 4).set<std::int16_t>(48, 5);
    Nifti flat;
    flat.set<std::int16_t>(46, 1);

    refusal_of(series.with(voxels), ErrorCode::Unsupported);
    refusal_of(flat.with(voxels), ErrorCode::InvalidInput);
    refusal_of(Nifti().type(128, 24).with(voxels), ErrorCode::Unsupported);
    refusal_of(Nifti().type(16, 64).with(voxels), ErrorCode::InvalidInput);
    refusal_of(Nifti().set<float>(108, 1e9F).with(voxels), ErrorCode::InvalidInput);
    refusal_of(Nifti().set<float>(108, std::numeric_limits<float>::quiet_NaN()).with(voxels),
               ErrorCode::InvalidInput);
    refusal_of(meta("ElementNumberOfChannels = 3\n", voxels), ErrorCode::Unsupported);
    refusal_of(nrrd("encoding: ascii", voxels), ErrorCode::Unsupported);
    refusal_of(meta("DistanceUnits = um\n", voxels), ErrorCode::Unsupported);
    refusal_of(nrrd("space units: \"mm\" \"mm\" \"um\"\nencoding: raw", voxels),
               ErrorCode::Unsupported);
    refusal_of(nrrd("axis mins: 1 2 3\nencoding: raw", voxels), ErrorCode::Unsupported);
    refusal_of("solid cube\nendsolid\n", ErrorCode::Unsupported);
    refusal_of("", ErrorCode::Unsupported);
}

TEST(ReadSizeImage, RefusesAxesThatAreNotAtRightAngles) {
    const std::string voxels = counted_voxels<float>();

    refusal_of(nrrd("space: left-posterior-superior\n"
                    "space directions: (1,0,0) (0.5,1,0) (0,0,1)\nencoding: raw",
                    voxels),
               ErrorCode::Unsupported);
    refusal_of(nrrd("space: left-posterior-superior\n"
                    "space directions: (1,0,0) (nan,1,0) (0,0,1)\nencoding: raw",
                    voxels),
               ErrorCode::InvalidInput);
}

// ITK aborts the process on such matrices.
TEST(ReadSizeImage, RefusesNiftiThatDoesNotSayWhereItIs) {
    const std::string voxels = counted_voxels<float>();
    const float nan = std::numeric_limits<float>::quiet_NaN();

    refusal_of(Nifti().sform({{{nan, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}).with(voxels),
               ErrorCode::InvalidInput);
    refusal_of(Nifti().sform({{{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}).with(voxels),
               ErrorCode::InvalidInput);
    refusal_of(Nifti().set<float>(80, 0.0F).with(voxels), ErrorCode::InvalidInput);
    refusal_of(Nifti().set<std::int16_t>(252, 1).set<float>(256, nan).with(voxels),
               ErrorCode::InvalidInput);
}

// ITK aborts the process on some. std::hypot of three takes no notice of a NaN beside two zeros.
TEST(ReadSizeImage, SurvivesEachBadNumberOfANiftiHeader) {
    const std::string voxels = counted_voxels<float>();
    const float inf = std::numeric_limits<float>::infinity();
    const std::array<float, 8> bad{
        std::numeric_limits<float>::quiet_NaN(), inf, -inf, 1e30F, -1e9F, 1e-40F, 0.0F, -1.0F};
    std::vector<std::size_t> places;
    for (std::size_t place = 76; place < 108; place += 4) {
        places.push_back(place);  // pixdim
    }
    for (std::size_t place = 256; place < 328; place += 4) {
        places.push_back(place);  // qform and sform
    }
    int refused = 0;

    for (const std::size_t place : places) {
        for (const float number : bad) {
            for (std::int16_t codes = 0; codes < 4; ++codes) {
                Nifti file;
                if ((codes & 1) != 0) {
                    file.sform({{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}});
                }
                file.set<std::int16_t>(252, static_cast<std::int16_t>(codes >> 1));
                file.set<float>(place, number);
                try {
                    const SizeImage image = read_size_image(file.with(voxels));
                    EXPECT_TRUE(image.axes.allFinite() && image.origin.allFinite());
                } catch (const Error&) {
                    ++refused;
                }
            }
        }
    }

    EXPECT_GT(refused, 300);
}

TEST(ReadSizeImage, SurvivesEachBadNumberOfATextHeader) {
    const std::string voxels = counted_voxels<float>();
    const std::vector<std::string> axes{"1", "0", "0", "0", "1", "0", "0", "0", "1"};
    int refused = 0;
    const auto feed = [&](const std::string& bytes) {
        try {
            const SizeImage image = read_size_image(bytes);
            EXPECT_TRUE(image.axes.allFinite() && image.origin.allFinite());
            EXPECT_TRUE(image.spacing.allFinite());
        } catch (const Error&) {
            ++refused;
        }
    };

    for (const std::string number :
         {"nan", "inf", "-inf", "1e300", "1e-300", "0", "none", "1e999"}) {
        for (std::size_t i = 0; i < axes.size(); ++i) {
            std::vector<std::string> a = axes;
            a[i] = number;
            feed(nrrd("space: left-posterior-superior\nspace directions: (" + a[0] + ',' + a[1] +
                          ',' + a[2] + ") (" + a[3] + ',' + a[4] + ',' + a[5] + ") (" + a[6] + ',' +
                          a[7] + ',' + a[8] + ")\nspace origin: (0,0,0)\nencoding: raw",
                      voxels));
            std::string matrix = "TransformMatrix =";
            for (const std::string& entry : a) {
                matrix += ' ' + entry;
            }
            feed(meta(matrix + "\nOffset = 1 2 3\nElementSpacing = 1 1 1\n", voxels));
        }
        feed(
            nrrd("space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
                 "space origin: (" +
                     number + ",0,0)\nencoding: raw",
                 voxels));
        feed(meta("Offset = 1 2 " + number + "\nElementSpacing = 1 1 1\n", voxels));
        feed(meta("Offset = 1 2 3\nElementSpacing = 1 " + number + " 1\n", voxels));
    }

    EXPECT_GT(refused, 60);
}

// Each prefix, and each file with one byte turned: a lattice or an Error, never more.
TEST(ReadSizeImage, SurvivesDamagedFiles) {
    const std::string voxels = counted_voxels<float>();
    const std::vector<std::string> good{
        Nifti().with(voxels), gzipped(Nifti().with(voxels)),
        nrrd("space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
             "space origin: (0,0,0)\nencoding: raw",
             voxels),
        meta("TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\n", voxels)};
    int refused = 0;
    const auto feed = [&](const std::string& bytes) {
        try {
            const SizeImage image = read_size_image(bytes);
            EXPECT_EQ(image.sizes.size(), static_cast<std::size_t>(image.size[0]) *
                                              static_cast<std::size_t>(image.size[1]) *
                                              static_cast<std::size_t>(image.size[2]));
            EXPECT_TRUE(image.axes.allFinite());
        } catch (const Error&) {
            ++refused;
        }
    };

    for (const std::string& file : good) {
        for (std::size_t i = 0; i < file.size(); i += 3) {
            feed(file.substr(0, i));
            std::string damaged = file;
            damaged[i] = static_cast<char>(damaged[i] ^ (1 << (i % 8)));
            feed(damaged);
        }
    }

    EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace remesh::testing

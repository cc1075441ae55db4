#include <sys/mman.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <mutex>
#include <unistd.h>

#include "core/error.h"
#include "core/image/plain_image.h"

namespace remesh::image {
namespace {

namespace fs = std::filesystem;

constexpr double kRightAngle = 1e-3;  // Largest cosine between axes, and error of their lengths.

const char* name_of(ImageFormat format) {
    switch (format) {
        case ImageFormat::Nifti: return "NIfTI";
        case ImageFormat::Nrrd: return "NRRD";
        case ImageFormat::MetaImage: return "MetaImage";
    }
    return "image";
}

const char* extension_of(ImageFormat format) {
    switch (format) {
        case ImageFormat::Nifti: return ".nii";
        case ImageFormat::Nrrd: return ".nrrd";
        case ImageFormat::MetaImage: return ".mha";
    }
    return "";
}

/// A file in memory with a name in the file system, since ITK reads by names and goes by their
/// extensions. The image never touches a disk.
class NamedMemory {
public:
    explicit NamedMemory(const PlainImage& plain) : file_(memfd_create("size-image", MFD_CLOEXEC)) {
        if (file_ < 0) {
            fail();
        }
        write(plain.header);
        write(plain.inflated.empty() ? plain.voxels : std::string_view(plain.inflated));
        const std::string target =
            "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(file_);
        std::error_code error;
        // A container's file system may be read-only but for its shared memory.
        for (const fs::path& parent :
             {fs::temp_directory_path(error), fs::path("/tmp"), fs::path("/dev/shm")}) {
            std::string folder = parent / "remesh-XXXXXX";
            if (!parent.empty() && mkdtemp(folder.data()) != nullptr) {
                folder_ = folder;
                path_ = folder_ / (std::string("image") + extension_of(plain.format));
                fs::create_symlink(target, path_, error);
                if (error) {
                    fail();
                }
                return;
            }
        }
        fail();
    }
    NamedMemory(const NamedMemory&) = delete;
    NamedMemory& operator=(const NamedMemory&) = delete;
    ~NamedMemory() { clean_up(); }

    [[nodiscard]] std::string path() const { return path_.string(); }

private:
    void clean_up() {
        std::error_code ignored;
        if (!folder_.empty()) {
            fs::remove(path_, ignored);
            fs::remove(folder_, ignored);
        }
        if (file_ >= 0) {
            close(file_);
        }
    }
    [[noreturn]] void fail() {
        clean_up();
        throw Error(ErrorCode::Internal,
                    "a size image needs memory, and a folder to name it in: TMPDIR, /tmp or "
                    "/dev/shm");
    }
    void write(std::string_view bytes) {
        while (!bytes.empty()) {
            const ssize_t written = ::write(file_, bytes.data(), bytes.size());
            if (written < 0 && errno != EINTR) {
                fail();
            }
            bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
        }
    }

    int file_;
    fs::path folder_{};
    fs::path path_{};
};

itk::ImageIOBase::Pointer reader_of(ImageFormat format) {
    switch (format) {
        case ImageFormat::Nifti: return itk::NiftiImageIO::New().GetPointer();
        case ImageFormat::Nrrd: return itk::NrrdImageIO::New().GetPointer();
        case ImageFormat::MetaImage: return itk::MetaImageIO::New().GetPointer();
    }
    return nullptr;
}

template <typename T>
std::vector<float> read_voxels(itk::ImageIOBase& io, std::size_t voxels) {
    std::vector<T> stored(voxels);
    if (static_cast<std::size_t>(io.GetImageSizeInBytes()) != voxels * sizeof(T)) {
        throw Error(ErrorCode::InvalidInput, "a size image holds one number a voxel");
    }
    io.Read(stored.data());
    if constexpr (std::is_same_v<T, float>) {
        return stored;
    } else {
        std::vector<float> sizes(voxels);
        std::transform(stored.begin(), stored.end(), sizes.begin(),
                       [](T value) { return static_cast<float>(value); });
        return sizes;
    }
}

std::vector<float> read_voxels(itk::ImageIOBase& io, std::size_t voxels) {
    using Component = itk::IOComponentEnum;
    switch (io.GetComponentType()) {
        case Component::UCHAR: return read_voxels<unsigned char>(io, voxels);
        case Component::CHAR: return read_voxels<signed char>(io, voxels);
        case Component::USHORT: return read_voxels<unsigned short>(io, voxels);
        case Component::SHORT: return read_voxels<short>(io, voxels);
        case Component::UINT: return read_voxels<unsigned int>(io, voxels);
        case Component::INT: return read_voxels<int>(io, voxels);
        case Component::ULONG: return read_voxels<unsigned long>(io, voxels);
        case Component::LONG: return read_voxels<long>(io, voxels);
        case Component::ULONGLONG: return read_voxels<unsigned long long>(io, voxels);
        case Component::LONGLONG: return read_voxels<long long>(io, voxels);
        case Component::FLOAT: return read_voxels<float>(io, voxels);
        case Component::DOUBLE: return read_voxels<double>(io, voxels);
        default: throw Error(ErrorCode::Unsupported, "a size image holds one number a voxel");
    }
}

void require_good_geometry(const SizeImage& image, const std::string& format) {
    const bool is_finite = image.origin.allFinite() && image.spacing.allFinite() &&
                           image.axes.allFinite() && (image.spacing.array() > 0.0).all();
    if (!is_finite) {
        throw Error(ErrorCode::InvalidInput,
                    format + ": origin and spacing must be finite, spacing greater than 0");
    }
    const Eigen::Matrix3d skew = image.axes.transpose() * image.axes - Eigen::Matrix3d::Identity();
    if (skew.cwiseAbs().maxCoeff() > kRightAngle) {
        throw Error(ErrorCode::Unsupported,
                    format + ": the axes of a size image must be at right angles; resample it");
    }
}

SizeImage read(itk::ImageIOBase& io, const PlainImage& plain) {
    SizeImage image;
    io.ReadImageInformation();
    itk::ImageIORegion region(3);
    std::size_t voxels = 1;
    for (unsigned axis = 0; axis < 3; ++axis) {
        if (io.GetNumberOfDimensions() != 3 || io.GetNumberOfComponents() != 1 ||
            static_cast<std::int64_t>(io.GetDimensions(axis)) != plain.size[axis]) {
            throw Error(ErrorCode::InvalidInput,
                        std::string(name_of(plain.format)) + ": the header contradicts itself");
        }
        image.size[axis] = static_cast<Index>(plain.size[axis]);
        image.origin[axis] = io.GetOrigin(axis);
        image.spacing[axis] = io.GetSpacing(axis);
        const std::vector<double> direction = io.GetDirection(axis);
        image.axes.col(axis) = Vec3(direction.at(0), direction.at(1), direction.at(2));
        region.SetSize(axis, io.GetDimensions(axis));
        region.SetIndex(axis, 0);
        voxels *= static_cast<std::size_t>(plain.size[axis]);
    }
    require_good_geometry(image, name_of(plain.format));
    // Rounded in the header; distances must be kept exactly.
    image.axes.col(0).normalize();
    image.axes.col(1) -= image.axes.col(0).dot(image.axes.col(1)) * image.axes.col(0);
    image.axes.col(1).normalize();
    const double hand = image.axes.determinant() < 0.0 ? -1.0 : 1.0;
    image.axes.col(2) = hand * image.axes.col(0).cross(image.axes.col(1));
    io.SetIORegion(region);
    image.sizes = read_voxels(io, voxels);
    return image;
}

}  // namespace

SizeImage read_with_itk(const PlainImage& plain) {
    static std::mutex one_at_a_time;  // NrrdIO keeps its errors in globals.
    const std::scoped_lock lock(one_at_a_time);
    const NamedMemory file(plain);
    itk::Object::SetGlobalWarningDisplay(false);  // It would print them.
    try {
        const itk::ImageIOBase::Pointer io = reader_of(plain.format);
        io->SetFileName(file.path());
        return read(*io, plain);
    } catch (const itk::ExceptionObject&) {
        // Its message quotes the header, and names the file.
        throw Error(
            ErrorCode::InvalidInput,
            std::string(name_of(plain.format)) +
                ": ITK can't make sense of the header: the axes may not be at right angles, "
                "or numbers are missing");
    }
}

}  // namespace remesh::image

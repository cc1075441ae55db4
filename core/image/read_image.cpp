#include "core/image/read_image.h"

#include "core/error.h"
#include "core/image/plain_image.h"
#include "core/io/inflate.h"

namespace remesh {
namespace {

ImageFormat format_of(std::string_view bytes) {
    if (bytes.starts_with("NRRD000")) {
        return ImageFormat::Nrrd;
    }
    if (bytes.substr(0, 1024).find("ObjectType") != std::string_view::npos ||
        bytes.substr(0, 1024).find("NDims") != std::string_view::npos) {
        return ImageFormat::MetaImage;
    }
    const std::string head =
        io::is_gzip(bytes) ? io::gunzip_head(bytes, 348) : std::string(bytes.substr(0, 348));
    if (head.size() == 348 &&
        (head.substr(344, 2) == "n+" || head.substr(344, 2) == "ni" || head.substr(4, 2) == "n+")) {
        return ImageFormat::Nifti;
    }
    throw Error(ErrorCode::Unsupported,
                "a size image must be NIfTI, NRRD or MetaImage; this file is none of them");
}

image::PlainImage plain(std::string_view bytes, ImageFormat format, const ImageLimits& limits) {
    switch (format) {
        case ImageFormat::Nifti: return image::plain_nifti(bytes, limits);
        case ImageFormat::Nrrd: return image::plain_nrrd(bytes, limits);
        case ImageFormat::MetaImage: return image::plain_meta(bytes, limits);
    }
    throw Error(ErrorCode::Unsupported, "an unknown format of images");
}

}  // namespace

SizeImage read_size_image(std::string_view bytes, std::optional<ImageFormat> format,
                          const SurfaceFrame& frame, const ImageLimits& limits) {
    SizeImage image =
        image::read_with_itk(plain(bytes, format ? *format : format_of(bytes), limits));
    if (frame.space == SurfaceFrame::Space::Ras) {
        const Vec3 mirror(-1.0, -1.0, 1.0);
        image.origin = mirror.cwiseProduct(image.origin);
        image.axes = mirror.asDiagonal() * image.axes;
    }
    image.assumes_space = frame.space == SurfaceFrame::Space::Unknown;
    if (frame.millimeters != 1.0) {
        image.origin /= frame.millimeters;
        image.spacing /= frame.millimeters;
        for (float& size : image.sizes) {
            size = static_cast<float>(static_cast<double>(size) / frame.millimeters);
        }
    }
    return image;
}

}  // namespace remesh

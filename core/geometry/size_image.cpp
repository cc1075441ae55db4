#include "core/geometry/size_image.h"

namespace remesh {

Box SizeImage::bounds() const {
    Box box;
    for (unsigned corner = 0; corner < 8; ++corner) {
        Vec3 at;
        for (unsigned axis = 0; axis < 3; ++axis) {
            const double end = (corner >> axis & 1U) != 0U ? size[axis] - 0.5 : -0.5;
            at[axis] = end * spacing[axis];
        }
        box.include(origin + axes * at);
    }
    return box;
}

}  // namespace remesh

#include "core/io/mesh_io.h"

#include "core/exact/delaunay.h"

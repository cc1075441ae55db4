#include "core/exact/intersections.h"

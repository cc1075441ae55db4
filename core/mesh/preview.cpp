#include "core/mesh/preview.h"

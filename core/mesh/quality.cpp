#include "core/mesh/quality.h"

#include "core/stages/carve.h"

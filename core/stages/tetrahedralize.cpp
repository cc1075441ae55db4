#include "core/stages/tetrahedralize.h"

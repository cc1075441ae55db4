#include "core/stages/sizing.h"

#include "core/stages/seed.h"

#include "core/stages/relax.h"

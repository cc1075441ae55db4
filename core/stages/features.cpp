#include "core/stages/features.h"

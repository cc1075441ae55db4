#include "core/stages/improve.h"

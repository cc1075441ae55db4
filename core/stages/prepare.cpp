#include "core/stages/prepare.h"

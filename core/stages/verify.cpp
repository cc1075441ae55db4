#include "core/stages/verify.h"

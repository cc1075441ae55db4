#include "core/stages/sizing.h"
namespace remesh {}

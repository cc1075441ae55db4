#include "core/stages/features.h"
namespace remesh {}

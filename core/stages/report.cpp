#include "core/stages/report.h"

#include <cassert>
#define FW_ASSERT(CONDITION, ...) assert(CONDITION)

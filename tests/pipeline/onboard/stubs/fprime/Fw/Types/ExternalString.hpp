#include "FpConfig.hpp"

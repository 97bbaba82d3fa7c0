/* Types of F Prime's configuration. */
#ifndef FP_CONFIG_HPP
#define FP_CONFIG_HPP
#include <cinttypes>
#include <cstdint>
typedef uint8_t U8;
typedef uint32_t U32;
typedef int32_t I32;
typedef double F64;
typedef U32 FwIndexType;
typedef U32 FwAssertArgType;
#define FW_SERIALIZABLE_TO_STRING 0
#define FW_ENABLE_TEXT_LOGGING 0
#endif

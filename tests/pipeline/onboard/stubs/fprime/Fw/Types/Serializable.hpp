/* How F Prime writes messages: numbers in turn, the highest octet first. */
#ifndef FW_SERIALIZABLE_HPP
#define FW_SERIALIZABLE_HPP
#include "FpConfig.hpp"
#include <cstring>

namespace Fw {

enum SerializeStatus { FW_SERIALIZE_OK, FW_SERIALIZE_NO_ROOM_LEFT, FW_DESERIALIZE_SIZE_MISMATCH, FW_DESERIALIZE_FORMAT_ERROR };

class SerializeBufferBase;
class StringBase;

class Serializable {
  public:
    typedef U32 SizeType;
    virtual ~Serializable() {}
    virtual SerializeStatus serialize(SerializeBufferBase &buffer) const = 0;
    virtual SerializeStatus deserialize(SerializeBufferBase &buffer) = 0;
};

class SerializeBufferBase {
  public:
    SerializeBufferBase(U8 *octets, U32 size) : m_octets(octets), m_size(size) {}
    SerializeStatus serialize(U8 number) { return put(number, 1); }
    SerializeStatus serialize(U32 number) { return put(number, 4); }
    SerializeStatus serialize(I32 number) { return put(static_cast<U32>(number), 4); }
    SerializeStatus serialize(F64 number)
    {
        uint64_t bits = 0;
        std::memcpy(&bits, &number, sizeof bits);
        return put(bits, 8);
    }
    SerializeStatus serialize(const Serializable &message) { return message.serialize(*this); }
    SerializeStatus deserialize(U8 &number) { return take(number, 1); }
    SerializeStatus deserialize(U32 &number) { return take(number, 4); }
    SerializeStatus deserialize(I32 &number) { return take(number, 4); }
    SerializeStatus deserialize(F64 &number)
    {
        uint64_t bits = 0;
        SerializeStatus status = take(bits, 8);
        std::memcpy(&number, &bits, sizeof number);
        return status;
    }
    SerializeStatus deserialize(Serializable &message) { return message.deserialize(*this); }
    SerializeStatus setBuffLen(U32 length)
    {
        m_length = length;
        return FW_SERIALIZE_OK;
    }

  private:
    SerializeStatus put(uint64_t number, U32 size)
    {
        if (m_length + size > m_size) {
            return FW_SERIALIZE_NO_ROOM_LEFT;
        }
        for (U32 octet = 0; octet < size; ++octet) {
            m_octets[m_length + octet] = static_cast<U8>(number >> (8 * (size - 1 - octet)));
        }
        m_length += size;
        return FW_SERIALIZE_OK;
    }
    template <typename Number> SerializeStatus take(Number &number, U32 size)
    {
        uint64_t bits = 0;
        if (m_taken + size > m_length) {
            return FW_DESERIALIZE_SIZE_MISMATCH;
        }
        for (U32 octet = 0; octet < size; ++octet) {
            bits = (bits << 8) | m_octets[m_taken + octet];
        }
        m_taken += size;
        number = static_cast<Number>(bits);
        return FW_SERIALIZE_OK;
    }
    U8 *m_octets;
    U32 m_size;
    U32 m_length = 0;
    U32 m_taken = 0;
};

class ExternalSerializeBuffer : public SerializeBufferBase {
  public:
    ExternalSerializeBuffer(U8 *octets, U32 size) : SerializeBufferBase(octets, size) {}
};

} // namespace Fw
#endif

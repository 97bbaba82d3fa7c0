/* The component of F Prime: octets of a start and of steps come in, those of what is fired go out. */
#include "Controller.hpp"
#include "packets.h"

#include <cstdio>

using namespace Inspection;

template <typename Message> static bool next(Message &message)
{
    U8 octets[Message::SERIALIZED_SIZE];
    Fw::ExternalSerializeBuffer buffer(octets, sizeof octets);
    buffer.setBuffLen(sizeof octets);
    return std::fread(octets, 1, sizeof octets, stdin) == sizeof octets && message.deserialize(buffer) == Fw::FW_SERIALIZE_OK;
}

template <typename Message> static void print(const Message &message)
{
    U8 octets[Message::SERIALIZED_SIZE];
    Fw::ExternalSerializeBuffer buffer(octets, sizeof octets);
    (void)message.serialize(buffer);
    (void)std::fwrite(octets, 1, sizeof octets, stdout);
}

int main()
{
    static Controller controller("controller");
    ControllerComponentBase &component = controller;
    StartInput start;
    StepInput step;

    if (!next(start)) {
        return 1;
    }
    component.begin_handler(0, start);
    while (next(step)) {
        component.known_handler(0, step);
        component.run_handler(0, 0);
        print(component.fired);
    }
    component.run_handler(0, 0); // without a message since the last one
    print(component.fired);
    return component.digests.size() == 192 ? 0 : 2;
}

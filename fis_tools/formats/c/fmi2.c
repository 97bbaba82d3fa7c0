/*
 * A fuzzy system as a block of the Functional Mock-up Interface 2.0 for co-simulation.
 *
 * What stands before this text defines GUID, NUM_INPUTS, NUM_OUTPUTS, START and infer(). The block has no
 * memory but for its inputs: outputs are what infer() gives for them whenever they are asked for, and a step
 * only lets time pass. References 0 to NUM_INPUTS - 1 are inputs, those after them outputs. What the model
 * description does not offer returns fmi2Error. Types as in the standard (https://fmi-standard.org).
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;

enum { CO_SIMULATION = 1 };

typedef struct {
    double inputs[NUM_INPUTS];
} Block;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const void *functions, int visible, int logging)
{
    Block *block = NULL;

    (void)name;
    (void)resources;
    (void)functions;
    (void)visible;
    (void)logging;
    if (type == CO_SIMULATION && guid != NULL && strcmp(guid, GUID) == 0) {
        block = malloc(sizeof *block);
    }
    if (block != NULL) {
        memcpy(block->inputs, START, sizeof block->inputs);
    }
    return block;
}

EXPORT void fmi2FreeInstance(void *block) { free(block); }

EXPORT fmi2Status fmi2Reset(void *block)
{
    memcpy(((Block *)block)->inputs, START, sizeof START);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(void *block, const unsigned int references[], size_t count,
                              const double values[])
{
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= NUM_INPUTS) {
            return fmi2Error;
        }
        ((Block *)block)->inputs[references[i]] = values[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(void *block, const unsigned int references[], size_t count, double values[])
{
    const double *inputs = ((const Block *)block)->inputs;
    double outputs[NUM_OUTPUTS];

    infer(inputs, outputs);
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= NUM_INPUTS + NUM_OUTPUTS) {
            return fmi2Error;
        }
        values[i] = references[i] < NUM_INPUTS ? inputs[references[i]] : outputs[references[i] - NUM_INPUTS];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetDebugLogging(void *block, int on, size_t count, const char *const categories[])
{
    (void)block;
    (void)on;
    (void)count;
    (void)categories;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(void *block, int has_tolerance, double tolerance, double start,
                                      int has_stop, double stop)
{
    (void)block;
    (void)has_tolerance;
    (void)tolerance;
    (void)start;
    (void)has_stop;
    (void)stop;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(void *block) { (void)block; return fmi2OK; }

EXPORT fmi2Status fmi2ExitInitializationMode(void *block) { (void)block; return fmi2OK; }

EXPORT fmi2Status fmi2Terminate(void *block) { (void)block; return fmi2OK; }

EXPORT fmi2Status fmi2DoStep(void *block, double time, double step, int keeps)
{
    (void)block;
    (void)time;
    (void)step;
    (void)keeps;
    return fmi2OK;
}

/* Of variables of other types there are none. */
#define OF_NONE(NAME, VALUES)                                                                            \
    EXPORT fmi2Status NAME(void *block, const unsigned int references[], size_t count, VALUES)           \
    {                                                                                                    \
        (void)block;                                                                                     \
        (void)references;                                                                                \
        (void)values;                                                                                    \
        return count == 0 ? fmi2OK : fmi2Error;                                                          \
    }
OF_NONE(fmi2GetInteger, int values[])
OF_NONE(fmi2GetBoolean, int values[])
OF_NONE(fmi2GetString, const char *values[])
OF_NONE(fmi2SetInteger, const int values[])
OF_NONE(fmi2SetBoolean, const int values[])
OF_NONE(fmi2SetString, const char *const values[])

/* A table of functions must be whole; these are not offered, whatever they are given. */
#define NOT_OFFERED(NAME) EXPORT fmi2Status NAME(void) { return fmi2Error; }
NOT_OFFERED(fmi2GetFMUstate)
NOT_OFFERED(fmi2SetFMUstate)
NOT_OFFERED(fmi2FreeFMUstate)
NOT_OFFERED(fmi2SerializedFMUstateSize)
NOT_OFFERED(fmi2SerializeFMUstate)
NOT_OFFERED(fmi2DeSerializeFMUstate)
NOT_OFFERED(fmi2GetDirectionalDerivative)
NOT_OFFERED(fmi2SetRealInputDerivatives)
NOT_OFFERED(fmi2GetRealOutputDerivatives)
NOT_OFFERED(fmi2CancelStep)
NOT_OFFERED(fmi2GetStatus)
NOT_OFFERED(fmi2GetRealStatus)
NOT_OFFERED(fmi2GetIntegerStatus)
NOT_OFFERED(fmi2GetBooleanStatus)
NOT_OFFERED(fmi2GetStringStatus)

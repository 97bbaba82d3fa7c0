/* Names and types of the core Flight System that the application uses; what they do is left out. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef uint32_t uint32;
typedef int32_t CFE_Status_t;
typedef struct { uint32_t Value; } CFE_SB_MsgId_t;
typedef struct { uint32_t Value; } CFE_SB_PipeId_t;
typedef size_t CFE_MSG_Size_t;
typedef struct { unsigned char Byte[6]; } CFE_MSG_Message_t;
typedef struct { CFE_MSG_Message_t Msg; unsigned char Sec[2]; } CFE_MSG_CommandHeader_t;
typedef struct { CFE_MSG_Message_t Msg; unsigned char Sec[6]; } CFE_MSG_TelemetryHeader_t;
typedef union { CFE_MSG_Message_t Msg; double Align; } CFE_SB_Buffer_t;

#define CFE_SB_INVALID_MSG_ID ((CFE_SB_MsgId_t){0})
#define CFE_SB_INVALID_PIPE ((CFE_SB_PipeId_t){0})
#define CFE_SUCCESS 0
#define CFE_MSG_PTR(header) (&(header).Msg)
#define CFE_SB_PEND_FOREVER (-1)
enum { CFE_EVS_EventType_ERROR = 3, CFE_EVS_EventFilter_BINARY = 0 };
enum { CFE_ES_RunStatus_APP_RUN = 1, CFE_ES_RunStatus_APP_ERROR = 3 };

CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *message, CFE_SB_MsgId_t *id);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *message, CFE_MSG_Size_t *size);
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *message, CFE_SB_MsgId_t id, CFE_MSG_Size_t size);
uint32_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t id);
CFE_SB_MsgId_t CFE_SB_ValueToMsgId(uint32_t value);
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *message);
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *message, bool is_origination);
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *pipe, uint16_t depth, const char *name);
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t id, CFE_SB_PipeId_t pipe);
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **buffer, CFE_SB_PipeId_t pipe, int32_t timeout);
CFE_Status_t CFE_EVS_Register(const void *filters, uint16_t count, uint16_t scheme);
CFE_Status_t CFE_EVS_SendEvent(uint16_t id, uint16_t type, const char *format, ...);
bool CFE_ES_RunLoop(uint32 *status);
void CFE_ES_ExitApp(uint32 status);

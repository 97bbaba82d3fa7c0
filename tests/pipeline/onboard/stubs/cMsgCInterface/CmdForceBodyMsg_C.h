/* Of Basilisk: a force in body axes. */
#include <stdint.h>
typedef struct { double forceRequestBody[3]; } CmdForceBodyMsgPayload;
typedef struct { int header; } CmdForceBodyMsg_C;
void CmdForceBodyMsg_C_init(CmdForceBodyMsg_C *message);
CmdForceBodyMsgPayload CmdForceBodyMsg_C_zeroMsgPayload(void);
void CmdForceBodyMsg_C_write(CmdForceBodyMsgPayload *payload, CmdForceBodyMsg_C *message, int64_t module, uint64_t time);

/* Of Basilisk: place and velocity relative to Hill axes. */
typedef struct { double r_DC_H[3]; double v_DC_H[3]; } HillRelStateMsgPayload;
typedef struct { int header; } HillRelStateMsg_C;
HillRelStateMsgPayload HillRelStateMsg_C_read(HillRelStateMsg_C *message);

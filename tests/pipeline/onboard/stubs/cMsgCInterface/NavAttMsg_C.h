/* Of Basilisk: an attitude. */
typedef struct { double timeTag; double sigma_BN[3]; } NavAttMsgPayload;
typedef struct { int header; } NavAttMsg_C;
NavAttMsgPayload NavAttMsg_C_read(NavAttMsg_C *message);

/* Of Basilisk: the logger of a module. */
typedef struct BSKLogger BSKLogger;

/* Of Basilisk: attitudes. */
void MRP2EP(double *q1, double *q);
void MRP2C(double *q, double C[3][3]);

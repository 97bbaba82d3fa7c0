/* Of Basilisk: products of vectors and matrices. */
void v3Copy(double v[3], double result[3]);
void m33MultV3(double mx[3][3], double v[3], double result[3]);

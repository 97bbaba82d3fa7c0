struct three {
    double x;
    double y;
    double z;
};

/* The smaller number; the second where they are equal or one is NaN. */
static double least(double a, double b)
{
    return (a < b) ? a : b;
}

/* The larger number; the second where they are equal or one is NaN. */
static double most(double a, double b)
{
    return (a > b) ? a : b;
}

/* An index, but not beyond the last one. */
static int at_most(int index, int last)
{
    return (index < last) ? index : last;
}

/* The sum over eight lanes: the upper half is added to the lower one until one is left. */
static double total(const double lanes[8])
{
    return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

/* A number, but within a billion, and zero for NaN: what inference is given, and what is commanded. */
static double finite_number(double x)
{
    double result = 0.0;

    if (x == x) {
        if (x > 1.0e9) {
            result = 1.0e9;
        } else if (x < -1.0e9) {
            result = -1.0e9;
        } else {
            result = x;
        }
    }
    return result;
}

/* The nearest whole number, the even one of two. */
/*@ requires -1050.0 <= x <= 1050.0;
    assigns \result \from x;
    ensures -1051.0 <= \result <= 1051.0; */
static double nearest_whole(double x)
{
    return rint(x);
}

/* Two to the power of a whole number from -1100 to 1023; zero for any other. */
/*@ assigns \result \from exponent;
    ensures \is_finite(\result) && 0.0 <= \result <= 1.0e308; */
static double power_of_two(double exponent)
{
    double result = 0.0;

    if (exponent == exponent) {
        if ((exponent >= -1100.0) && (exponent <= 1023.0)) {
            result = ldexp(1.0, (int)exponent);
        }
    }
    return result;
}

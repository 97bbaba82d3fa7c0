/* What written systems share beside functions transcribed from those that Python runs; each is written where
 * some system calls it. */

/* The last point of a universe that is not above x, for an x inside. */
static int point_below(const double universe[], int num_points, double x)
{
    int low = 0;
    int high = num_points - 1;

    while (low < high) {
        const int middle = high - ((high - low) / 2);

        if (universe[middle] <= x) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return low;
}

/* A sampled membership function at x, which lies on the point `left` of the universe or beyond it. */
static double membership_at(const double universe[], int num_points, const double sampled[], int left,
                            double x)
{
    double slope;

    if (!(x > universe[left])) {
        return sampled[left];
    }
    if (left == (num_points - 1)) {
        return 0.0;
    }
    slope = (sampled[left + 1] - sampled[left]) / (universe[left + 1] - universe[left]);
    return (slope * (x - universe[left])) + sampled[left];
}

/* How far x, clipped to the universe, belongs to each term. */
static void fuzzify(double x, const double universe[], int num_points, const double sampled[], int num_terms,
                    double degrees[])
{
    const double low = universe[0];
    const double high = universe[num_points - 1];
    const double inside = (x < low) ? low : ((x > high) ? high : x);
    const int left = point_below(universe, num_points, inside);

    for (int term = 0; term < num_terms; ++term) {
        degrees[term] = membership_at(universe, num_points, &sampled[term * num_points], left, inside);
    }
}

/* A number; in the place of an infinite one the end of a range. */
static double finite_or_end(double number, double low, double high)
{
    return (isinf(number) == 0) ? number : ((number > 0.0) ? high : low);
}

/* Adds a number that a rule concludes, by the strength of the rule. */
static void weigh(double strength, double number, double *total, double *moment)
{
    if (strength > 0.0) {
        *total += strength;
        *moment += strength * number;
    }
}

/* The same for an average: a power of two changes no digit, and products of faint strengths keep theirs. */
static void weigh_in(double strength, double number, double *total, double *moment)
{
    const double raised = strength * 340282366920938463463374607431768211456.0;

    weigh(raised, number, total, moment);
}

/* The input inside of its universe. */
static double inside(double x, double low, double high)
{
    return (x < low) ? low : ((x > high) ? high : x);
}

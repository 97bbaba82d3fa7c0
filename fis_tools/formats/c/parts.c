/* The functions that written systems share; each is written where some system calls it. Those of degrees of
 * truth are as in fis_tools.model.operators; IMPLICATION and AGGREGATION stand for some of these. */

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

/* Where terms cross their cuts between two points of the universe, ascending. Returns how many. */
static int cross(const double universe[], int num_points, const double sampled[], const double cuts[],
                 int num_terms, double crossings[])
{
    int count = 0;

    for (int term = 0; term < num_terms; ++term) {
        const double *const mf = &sampled[term * num_points];
        const double cut = cuts[term];

        for (int point = 0; point < (num_points - 1); ++point) {
            const bool is_left = (cut > 0.0) ? (mf[point] >= cut) : (mf[point] > 0.0);
            const bool is_right = (cut > 0.0) ? (mf[point + 1] >= cut) : (mf[point + 1] > 0.0);

            if (is_left != is_right) {
                const double width = universe[point + 1] - universe[point];
                const double x = universe[point] + ((cut - mf[point]) * width / (mf[point + 1] - mf[point]));
                int place = count;

                while ((place > 0) && (crossings[place - 1] > x)) {
                    crossings[place] = crossings[place - 1];
                    --place;
                }
                crossings[place] = x;
                ++count;
            }
        }
    }
    return count;
}

/* The highest of the cut terms at the points of the universe and at the crossings, ascending, each once.
 * Returns how many points there are. */
static int aggregate(const double universe[], int num_points, const double sampled[], const double cuts[],
                     int num_terms, double crossings[], double x[], double y[])
{
    const int num_crossings = cross(universe, num_points, sampled, cuts, num_terms, crossings);
    int point = 0;
    int crossing = 0;
    int count = 0;

    while ((point < num_points) || (crossing < num_crossings)) {
        double here;

        if ((crossing == num_crossings) ||
            ((point < num_points) && (universe[point] <= crossings[crossing]))) {
            here = universe[point];
            ++point;
        } else {
            here = crossings[crossing];
            ++crossing;
        }
        if ((count == 0) || (here > x[count - 1])) {
            double highest = 0.0;

            for (int term = 0; term < num_terms; ++term) {
                const double *const mf = &sampled[term * num_points];
                const double degree = membership_at(universe, num_points, mf, point - 1, here);
                const double height = (degree < cuts[term]) ? degree : cuts[term];

                highest = (height > highest) ? height : highest;
            }
            x[count] = here;
            y[count] = highest;
            ++count;
        }
    }
    return count;
}

static double greatest(const double y[], int count)
{
    double highest = 0.0;

    for (int point = 0; point < count; ++point) {
        highest = (y[point] > highest) ? y[point] : highest;
    }
    return highest;
}

static double fuzzy_not(double a)
{
    return fmax(1.0 - a, 0.0);
}

static double fuzzy_very(double a)
{
    return a * a;
}

static double fuzzy_somewhat(double a)
{
    return sqrt(fmax(a, 0.0));
}

static double fuzzy_extremely(double a)
{
    return a * a * a;
}

static double fuzzy_intensely(double a)
{
    return (a <= 0.5) ? (2.0 * a * a) : (1.0 - (2.0 * (1.0 - a) * (1.0 - a)));
}

static double fuzzy_seldom(double a)
{
    return (a <= 0.5) ? sqrt(0.5 * fmax(a, 0.0)) : (1.0 - sqrt(0.5 * fmax(1.0 - a, 0.0)));
}

static double fuzzy_min(double a, double b)
{
    return (a < b) ? a : b;
}

static double fuzzy_product(double a, double b)
{
    return a * b;
}

static double fuzzy_bounded_difference(double a, double b)
{
    return ((a + b - 1.0) > 0.0) ? (a + b - 1.0) : 0.0;
}

static double fuzzy_einstein_product(double a, double b)
{
    return a * b / (2.0 - (a + b - (a * b)));
}

static double fuzzy_hamacher_product(double a, double b)
{
    return ((a + b - (a * b)) == 0.0) ? 0.0 : (a * b / (a + b - (a * b)));
}

static double fuzzy_drastic_product(double a, double b)
{
    return (b >= 1.0) ? a : ((a >= 1.0) ? b : 0.0);
}

static double fuzzy_nilpotent_minimum(double a, double b)
{
    return ((a + b) > 1.0) ? ((a < b) ? a : b) : 0.0;
}

static double fuzzy_max(double a, double b)
{
    return (a > b) ? a : b;
}

static double fuzzy_probabilistic_sum(double a, double b)
{
    return a + b - (a * b);
}

static double fuzzy_bounded_sum(double a, double b)
{
    return ((a + b) < 1.0) ? (a + b) : 1.0;
}

static double fuzzy_einstein_sum(double a, double b)
{
    return (a + b) / (1.0 + (a * b));
}

static double fuzzy_hamacher_sum(double a, double b)
{
    return ((a * b) < 0.5) ? fmin((a + b - (2.0 * (a * b))) / (1.0 - (a * b)), 1.0) : (((a * b) == 1.0) ? 1.0 : (1.0 - ((1.0 - a) * (1.0 - b) / (1.0 - (a * b)))));
}

static double fuzzy_drastic_sum(double a, double b)
{
    return (b <= 0.0) ? a : ((a <= 0.0) ? b : 1.0);
}

static double fuzzy_nilpotent_maximum(double a, double b)
{
    return ((a + b) < 1.0) ? ((a > b) ? a : b) : 1.0;
}

static double fuzzy_unbounded_sum(double a, double b)
{
    return a + b;
}

/* The centre of area of a polygon, summed segment by segment. */
static double centroid(const double x[], const double y[], int count)
{
    double moment = 0.0;
    double area = 0.0;

    for (int point = 1; point < count; ++point) {
        const double x1 = x[point - 1];
        const double h1 = y[point - 1];
        const double h2 = y[point];
        const double width = x[point] - x1;
        double centre;
        double segment;

        if (h1 == h2) {
            centre = 0.5 * (x1 + x[point]);
            segment = width * h1;
        } else if (h1 == 0.0) {
            centre = (2.0 / 3.0 * width) + x1;
            segment = 0.5 * width * h2;
        } else if (h2 == 0.0) {
            centre = (1.0 / 3.0 * width) + x1;
            segment = 0.5 * width * h1;
        } else {
            centre = ((2.0 / 3.0 * width * (h2 + (0.5 * h1))) / (h1 + h2)) + x1;
            segment = 0.5 * width * (h1 + h2);
        }
        moment += centre * segment;
        area += segment;
    }
    return moment / ((area > 2.220446049250313e-16) ? area : 2.220446049250313e-16);
}

static double segment_area(const double x[], const double y[], int point)
{
    const double width = x[point] - x[point - 1];

    return (y[point - 1] == y[point]) ? (width * y[point]) : (0.5 * width * (y[point - 1] + y[point]));
}

/* Where half of the area of a polygon lies on either side. As in scikit-fuzzy an empty segment starts the
 * area left of it anew, so that with a gap in the polygon this is another point, or NaN. */
static double bisector(const double x[], const double y[], int count)
{
    double total = 0.0;
    double sum = 0.0;
    double left = 0.0;
    double here = 0.0;
    double rest;
    double width;
    double slope;
    double h1;
    double h2;
    int point;

    for (point = 1; point < count; ++point) {
        total += segment_area(x, y, point);
    }
    for (point = 1; point < count; ++point) {
        left = here;
        sum += segment_area(x, y, point);
        here = ((y[point - 1] == 0.0) && (y[point] == 0.0)) ? 0.0 : sum;
        if (here >= (total / 2.0)) {
            break;
        }
    }
    rest = (total / 2.0) - left;
    width = x[point] - x[point - 1];
    h1 = y[point - 1];
    h2 = y[point];
    if (h1 == h2) {
        return (rest / h1) + x[point - 1];
    }
    if (h1 == 0.0) {
        return x[point - 1] + sqrt(2.0 * rest * width / h2);
    }
    if (h2 == 0.0) {
        return x[point] - sqrt((width * width) - (2.0 * rest * width / h1));
    }
    slope = (h2 - h1) / width;
    return x[point - 1] - ((h1 - sqrt((h1 * h1) + (2.0 * slope * rest))) / slope);
}

/* The mean of the highest points. */
static double mean_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    double sum = 0.0;
    int found = 0;

    for (int point = 0; point < count; ++point) {
        if (y[point] == highest) {
            sum += x[point];
            ++found;
        }
    }
    return sum / found;
}

/* The least of the highest points. */
static double smallest_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int point = 0;

    while (y[point] < highest) {
        ++point;
    }
    return x[point];
}

/* The greatest of the highest points. */
static double largest_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int point = count - 1;

    while (y[point] < highest) {
        --point;
    }
    return x[point];
}

/* What a rule implies, aggregated with what those before it imply. */
static void conclude_by_IMPLICATION_and_AGGREGATION(const double sampled[], int num_points, double strength, double heights[])
{

    for (int point = 0; point < num_points; ++point) {
        heights[point] = fuzzy_AGGREGATION(heights[point], fuzzy_IMPLICATION(strength, sampled[point]));
    }
}

/* Adds a number that a rule concludes, by the strength of the rule. */
static void weigh(double strength, double number, double *total, double *moment)
{
    if (strength > 0.0) {
        *total += strength;
        *moment += strength * number;
    }
}

/* The input inside of its universe. */
static double inside(double x, double low, double high)
{
    return (x < low) ? low : ((x > high) ? high : x);
}

/* Where ramp from start and end has a degree above zero. */
static double where_ramp(double degree, double start, double end)
{
    return start + ((end - start) * degree);
}

/* Where sigmoid from inflection and slope has a degree above zero. */
static double where_sigmoid(double degree, double inflection, double slope)
{
    return inflection - (log((1.0 / degree) - 1.0) / slope);
}

/* Where s_shape from foot and top has a degree above zero. */
static double where_s_shape(double degree, double foot, double top)
{
    return (degree <= 0.5) ? (foot + ((top - foot) * sqrt(degree / 2.0)))
                           : (top - ((top - foot) * sqrt((1.0 - degree) / 2.0)));
}

/* Where z_shape from top and foot has a degree above zero. */
static double where_z_shape(double degree, double top, double foot)
{
    return (degree <= 0.5) ? (foot + ((top - foot) * sqrt(degree / 2.0)))
                           : (top - ((top - foot) * sqrt((1.0 - degree) / 2.0)));
}

/* Where concave from inflection and end has a degree above zero. */
static double where_concave(double degree, double inflection, double end)
{
    return (2.0 * end) - inflection + ((inflection - end) / degree);
}

/* Where arc from start and end has a degree above zero. */
static double where_arc(double degree, double start, double end)
{
    return end + ((start - end) * sqrt(1.0 - (degree * degree)));
}

/* How far x belongs to a Gaussian. */
static double degree_gaussian(double x, double mean, double deviation)
{
    return exp(-((x - mean) * (x - mean)) / (2.0 * (deviation * deviation)));
}

/* How far x belongs to a trapezoid. */
static double degree_trapezoidal(double x, double left, double left_top, double right_top, double right)
{
    if ((x >= left_top) && (x <= right_top)) {
        return 1.0;
    }
    if ((x > left) && (x < left_top)) {
        return (x - left) / (left_top - left);
    }
    return ((x > right_top) && (x < right)) ? ((right - x) / (right - right_top)) : 0.0;
}

/* How far x belongs to a triangle. */
static double degree_triangular(double x, double left, double peak, double right)
{
    return degree_trapezoidal(x, left, peak, peak, right);
}

/* How far x belongs to two Gaussians with a top between them. */
static double degree_two_sided_gaussian(double x, double left_mean, double left_deviation, double right_mean,
                                        double right_deviation)
{
    const double left = (x <= left_mean) ? degree_gaussian(x, left_mean, left_deviation) : 1.0;

    return (x > right_mean) ? (left * degree_gaussian(x, right_mean, right_deviation)) : left;
}

/* How far x belongs to a bell. */
static double degree_generalized_bell(double x, double width, double slope, double centre)
{
    return 1.0 / (1.0 + pow(fabs((x - centre) / width), 2.0 * slope));
}

/* How far x belongs to a sigmoid. */
static double degree_sigmoid(double x, double inflection, double slope)
{
    return 1.0 / (1.0 + exp(-slope * (x - inflection)));
}

/* How far x belongs to the difference of two sigmoids. */
static double degree_sigmoid_difference(double x, double first, double first_slope, double second,
                                        double second_slope)
{
    return fabs(degree_sigmoid(x, first, first_slope) - degree_sigmoid(x, second, second_slope));
}

/* How far x belongs to the product of two sigmoids. */
static double degree_sigmoid_product(double x, double first, double first_slope, double second,
                                     double second_slope)
{
    return degree_sigmoid(x, first, first_slope) * degree_sigmoid(x, second, second_slope);
}

/* How far x belongs to two parabolas that rise. */
static double degree_s_shape(double x, double foot, double top)
{
    const double from_foot = (x - foot) / (top - foot);
    const double from_top = (x - top) / (top - foot);

    if (x <= foot) {
        return 0.0;
    }
    if (x >= top) {
        return 1.0;
    }
    return (x >= (0.5 * (foot + top))) ? (1.0 - (2.0 * from_top * from_top)) : (2.0 * from_foot * from_foot);
}

/* How far x belongs to two parabolas that fall. */
static double degree_z_shape(double x, double top, double foot)
{
    return degree_s_shape(-x, -foot, -top);
}

/* How far x belongs to an S shape and a Z shape with a top between them. */
static double degree_pi_shape(double x, double left, double left_top, double right_top, double right)
{
    return (x >= right_top) ? degree_z_shape(x, right_top, right) : degree_s_shape(x, left, left_top);
}

/* How far x belongs to a spike. */
static double degree_spike(double x, double centre, double width)
{
    return exp(-fabs(10.0 / width * (x - centre)));
}

/* How far x belongs to one period of a cosine. */
static double degree_cosine(double x, double centre, double width)
{
    return (fabs(x - centre) <= (0.5 * width))
        ? (0.5 * (1.0 + cos(2.0 / width * 3.141592653589793 * (x - centre))))
        : 0.0;
}

/* How far x belongs to a concave curve. */
static double degree_concave(double x, double inflection, double end)
{
    const bool is_below = (end >= inflection) ? (x < end) : (x > end);

    return is_below ? ((end - inflection) / ((2.0 * end) - inflection - x)) : 1.0;
}

/* The height of a circle of a radius, scaled to one. */
static double circle(double x, double centre, double radius)
{
    return sqrt(fmax((radius * radius) - ((x - centre) * (x - centre)), 0.0)) / radius;
}

/* How far x belongs to half of an ellipse. */
static double degree_semi_ellipse(double x, double start, double end)
{
    return circle(x, start + (0.5 * (end - start)), 0.5 * (end - start));
}

/* How far x belongs to a quarter of an ellipse. */
static double degree_arc(double x, double start, double end)
{
    const bool is_beyond = (end > start) ? (x > end) : (x < end);

    return is_beyond ? 1.0 : circle(x, end, fabs(end - start));
}

/* How far x belongs to a ramp. */
static double degree_ramp(double x, double start, double end)
{
    return fmin(fmax((x - start) / (end - start), 0.0), 1.0);
}

/* How far x belongs to straight lines between points, level beyond them. */
static double degree_table(double x, const double points[], const double values[], int count)
{
    int right = 0;

    if (x <= points[0]) {
        return values[0];
    }
    if (x > points[count - 1]) {
        return values[count - 1];
    }
    while (points[right] < x) {
        ++right;
    }
    if (!(points[right] > x)) {
        return values[right];
    }
    return values[right - 1]
        + ((values[right] - values[right - 1])
           * ((x - points[right - 1]) / (points[right] - points[right - 1])));
}

/* A degree of truth, zero where it is too small to count. */
static double counted(double degree)
{
    return (degree >= 1e-290) ? degree : 0.0;
}

/* What heights are multiplied by before they are summed: products with faint ones would lose digits, a power of
 * two adds no rounding. */
static double raise_faint(const double y[], int count)
{
    return (greatest(y, count) < 1e-200) ? ldexp(1.0, 600) : 1.0;
}

/* The mean of points, weighted by heights. */
static double sampled_centroid(const double x[], const double y[], int count)
{
    const double scale = raise_faint(y, count);
    double moment = 0.0;
    double area = 0.0;

    for (int point = 0; point < count; ++point) {
        area += y[point] * scale;
        moment += x[point] * (y[point] * scale);
    }
    return fmin(fmax(moment / area, x[0]), x[count - 1]);
}

/* The first point at which half of the sum of heights is reached, as in MATLAB. */
static double sampled_bisector_matlab(const double x[], const double y[], int count)
{
    const double scale = raise_faint(y, count);
    double total = 0.0;
    double running = 0.0;
    int point;

    for (point = 0; point < count; ++point) {
        total += y[point] * scale;
    }
    for (point = 0; point < (count - 1); ++point) {
        running += y[point] * scale;
        if (running >= (total / 2.0 * (1.0 - 1e-12))) {
            break;
        }
    }
    return x[point];
}

/* The mean of the points whose running share of the sum is nearest to a half, as in fuzzylite. */
static double sampled_bisector_fuzzylite(const double x[], const double y[], int count)
{
    const double scale = raise_faint(y, count);
    double total = 0.0;
    double running = 0.0;
    double nearest = 2.0;
    double moment = 0.0;
    int found = 0;

    for (int point = 0; point < count; ++point) {
        total += y[point] * scale;
    }
    for (int point = 0; point < count; ++point) {
        running += y[point] * scale;
        nearest = fmin(nearest, fabs((running / total) - 0.5));
    }
    running = 0.0;
    for (int point = 0; point < count; ++point) {
        running += y[point] * scale;
        if (fabs((running / total) - 0.5) <= (nearest + 1e-12)) {
            ++found;
            moment += x[point];
        }
    }
    return moment / found;
}

/* Where walks from both ends meet, always on the side with the smaller sum, as in jFuzzyLogic, which finds
 * nothing where all that it summed from the left is zero. */
static double sampled_bisector_fcl(const double x[], const double y[], int count, double nothing)
{
    double sum_low = 0.0;
    double sum_high = 0.0;
    int low = 0;
    int high = count - 1;

    while (low < high) {
        if (sum_low <= (sum_high * (1.0 + 1e-12))) {
            ++low;
            sum_low += y[low];
        } else {
            --high;
            sum_high += y[high];
        }
    }
    return (sum_low > 0.0) ? fmin(x[0] + ((x[1] - x[0]) * low), x[count - 1]) : nothing;
}

/* Whether a height is the highest up to rounding. */
static bool is_top(double height, double highest)
{
    return height >= (highest * (1.0 - 1e-12));
}

/* The mean of the highest points. */
static double sampled_mean_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    double sum = 0.0;
    int found = 0;

    for (int point = 0; point < count; ++point) {
        if (is_top(y[point], highest)) {
            sum += x[point];
            ++found;
        }
    }
    return sum / found;
}

/* The least of the highest points. */
static double sampled_smallest_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int point = 0;

    while (!is_top(y[point], highest)) {
        ++point;
    }
    return x[point];
}

/* The greatest of the highest points. */
static double sampled_largest_of_maximum(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int point = count - 1;

    while (!is_top(y[point], highest)) {
        --point;
    }
    return x[point];
}

/* The highest point of the smallest magnitude, as in MATLAB. */
static double sampled_smallest_of_maximum_matlab(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int best = -1;

    for (int point = 0; point < count; ++point) {
        if (is_top(y[point], highest) && ((best < 0) || (fabs(x[point]) < fabs(x[best])))) {
            best = point;
        }
    }
    return x[best];
}

/* The highest point of the largest magnitude, as in MATLAB. */
static double sampled_largest_of_maximum_matlab(const double x[], const double y[], int count)
{
    const double highest = greatest(y, count);
    int best = -1;

    for (int point = 0; point < count; ++point) {
        if (is_top(y[point], highest) && ((best < 0) || (fabs(x[point]) > fabs(x[best])))) {
            best = point;
        }
    }
    return x[best];
}

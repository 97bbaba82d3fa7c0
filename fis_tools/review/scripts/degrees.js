// Membership functions by their formulas, as fis_tools/engines/degrees.py has them: also beyond a range.

const SMALLEST_MEMBERSHIP = 1e-290;

const gaussianAt = (x, mean, deviation) => Math.exp(-((x - mean) * (x - mean)) / (2 * (deviation * deviation)));
const sigmoidAt = (x, inflection, slope) => 1 / (1 + Math.exp(-slope * (x - inflection)));
const circleAt = (x, centre, radius) => Math.sqrt(Math.max(radius * radius - (x - centre) * (x - centre), 0)) / radius;

function trapezoidAt(x, left, leftTop, rightTop, right) {
  if (x >= leftTop && x <= rightTop) return 1;
  if (x > left && x < leftTop) return (x - left) / (leftTop - left);
  return x > rightTop && x < right ? (right - x) / (right - rightTop) : 0;
}

/** Two parabolas that rise from zero at a foot over one half in the middle to one at a top. */
function parabolasAt(x, foot, top) {
  if (x <= foot) return 0;
  if (x >= top) return 1;
  const [fromTop, fromFoot] = [(x - top) / (top - foot), (x - foot) / (top - foot)];
  return x >= 0.5 * (foot + top) ? 1 - 2 * fromTop * fromTop : 2 * fromFoot * fromFoot;
}

/** Each shape by its name in controller files, at x with its numbers in their order. */
const SHAPES = {
  gaussian: gaussianAt,
  triangular: (x, left, peak, right) => trapezoidAt(x, left, peak, peak, right),
  trapezoidal: trapezoidAt,
  two_sided_gaussian: (x, a, b, c, d) => (x <= a ? gaussianAt(x, a, b) : 1) * (x > c ? gaussianAt(x, c, d) : 1),
  generalized_bell: (x, width, slope, centre) => 1 / (1 + Math.abs((x - centre) / width) ** (2 * slope)),
  sigmoid: sigmoidAt,
  sigmoid_difference: (x, a, b, c, d) => Math.abs(sigmoidAt(x, a, b) - sigmoidAt(x, c, d)),
  sigmoid_product: (x, a, b, c, d) => sigmoidAt(x, a, b) * sigmoidAt(x, c, d),
  s_shape: parabolasAt,
  z_shape: (x, top, foot) => parabolasAt(-x, -foot, -top),
  pi_shape: (x, a, b, c, d) => (x >= c ? parabolasAt(-x, -d, -c) : parabolasAt(x, a, b)),
  spike: (x, centre, width) => Math.exp(-Math.abs((10 / width) * (x - centre))),
  cosine: (x, centre, width) =>
    Math.abs(x - centre) <= 0.5 * width ? 0.5 * (1 + Math.cos((2 / width) * Math.PI * (x - centre))) : 0,
  concave: (x, inflection, end) =>
    (end >= inflection ? x < end : x > end) ? (end - inflection) / (2 * end - inflection - x) : 1,
  semi_ellipse: (x, start, end) => circleAt(x, start + 0.5 * (end - start), 0.5 * (end - start)),
  arc: (x, start, end) => ((end > start ? x > end : x < end) ? 1 : circleAt(x, end, Math.abs(end - start))),
  ramp: (x, start, end) => Math.min(Math.max((x - start) / (end - start), 0), 1),
};

/** Straight between points, level beyond; at a jump the first of both. */
function tableAt(x, points, values) {
  if (x <= points[0]) return values[0];
  if (x > points[points.length - 1]) return values[points.length - 1];
  let right = 0;
  while (points[right] < x) right++;
  if (points[right] === x) return values[right];
  const share = (x - points[right - 1]) / (points[right] - points[right - 1]);
  return values[right - 1] + (values[right] - values[right - 1]) * share;
}

/** How far a value, which may lie outside of the range, belongs to a term. */
function degreeAt(x, { shape, numbers, points, heights }) {
  const value = shape in SHAPES ? SHAPES[shape](x, ...numbers) : tableAt(x, points, heights);
  return value >= SMALLEST_MEMBERSHIP ? value : 0;
}

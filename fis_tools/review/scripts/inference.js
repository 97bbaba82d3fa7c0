// Mamdani inference, step by step, with the arithmetic of fis_tools/inference.py in the same order.

const SMALLEST_AREA = 2 ** -52;
// Heights of sampled outputs that differ by less are equal but for rounding.
const TIE = 1e-12;

/** The place of the last point of an ascending grid that is not above x; -1 below the first. */
function placeIn(grid, x) {
  let low = 0;
  let high = grid.length;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (grid[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Interpolate at x, which lies at or after grid[place] and before the next point, as numpy does. */
function interpolate(x, grid, values, place) {
  if (x === grid[place] || place === grid.length - 1) return values[place];
  const slope = (values[place + 1] - values[place]) / (grid[place + 1] - grid[place]);
  return slope * (x - grid[place]) + values[place];
}

/** Whether outputs are sums over points, and memberships formulas of inputs that are not clipped. */
function isSampled({ semantics }) {
  return semantics !== "scikit-fuzzy";
}

/** Bring each input into its universe, where the program does. */
function clipInputs(system, inputs) {
  return system.inputs.map(({ universe, clip }, place) => {
    if (isSampled(system) && !clip) return inputs[place];
    return Math.max(Math.min(inputs[place], universe[universe.length - 1]), universe[0]);
  });
}

/** How far each clipped input belongs to each of its terms: an array an input. */
function fuzzify(system, clipped) {
  return system.inputs.map(({ universe, terms }, input) => {
    if (isSampled(system)) return terms.map((term) => degreeAt(clipped[input], term));
    const place = placeIn(universe, clipped[input]);
    return terms.map((term) => interpolate(clipped[input], universe, term.values, place));
  });
}

/** How far an expression of a rule holds: ["is", input, term], ["not" or a hedge, x], ["and" or "or", [x, …]]. */
function degree(rule, expression, memberships) {
  const [kind, operand, term] = expression;
  if (kind === "is") return memberships[operand][term];
  if (kind === "not") return Math.max(1 - degree(rule, operand, memberships), 0);
  if (kind in HEDGES) return HEDGES[kind](degree(rule, operand, memberships));
  const combine = kind === "and" ? AND_OPERATORS[rule.and_operator] : OR_OPERATORS[rule.or_operator];
  let combined = degree(rule, operand[0], memberships);
  for (let i = 1; i < operand.length; i++) combined = combine(combined, degree(rule, operand[i], memberships));
  return combined;
}

/** How strongly each rule fires, before weights. */
function fire(system, memberships) {
  return Float64Array.from(system.rules, (rule) => degree(rule, rule.antecedent, memberships));
}

/** The height each term of an output is cut at; NaN for a term that no rule concludes. */
function cutTerms(system, output, firing) {
  const accumulate = ACCUMULATIONS[system.outputs[output].accumulation];
  const cuts = new Float64Array(system.outputs[output].terms.length).fill(NaN);
  system.rules.forEach((rule, index) => {
    for (const [variable, term, weight] of rule.consequents) {
      if (variable !== output) continue;
      const activation = firing[index] * weight;
      cuts[term] = Number.isNaN(cuts[term]) ? activation : accumulate(activation, cuts[term]);
    }
  });
  return cuts;
}

/** Add to `found` where a membership function crosses its cut between two points of the grid. */
function addCrossings(found, grid, values, cut) {
  const reaches = (value) => (cut === 0 ? value > cut : value >= cut);
  let isReached = reaches(values[0]);
  for (let i = 0; i + 1 < grid.length; i++) {
    const wasReached = isReached;
    isReached = reaches(values[i + 1]);
    if (wasReached !== isReached) {
      found.push(grid[i] + ((cut - values[i]) * (grid[i + 1] - grid[i])) / (values[i + 1] - values[i]));
    }
  }
}

/** Join the points of a grid and others, ascending, each once. */
function joinPoints(grid, others) {
  const sorted = Float64Array.from(others).sort();
  const points = new Float64Array(grid.length + sorted.length);
  let count = 0;
  let next = 0;
  const add = (point) => {
    if (count === 0 || point !== points[count - 1]) points[count++] = point;
  };
  for (let i = 0; i < grid.length; i++) {
    while (next < sorted.length && sorted[next] < grid[i]) add(sorted[next++]);
    add(grid[i]);
  }
  while (next < sorted.length) add(sorted[next++]);
  return points.subarray(0, count);
}

/** The highest of the cut terms, at the universe's points and at the crossings: [points, heights]. */
function aggregate(variable, cuts) {
  const grid = variable.universe;
  const concluded = variable.terms.map((_, term) => term).filter((term) => !Number.isNaN(cuts[term]));
  const crossings = [];
  for (const term of concluded) addCrossings(crossings, grid, variable.terms[term].values, cuts[term]);
  const points = joinPoints(grid, crossings);
  const heights = new Float64Array(points.length);
  for (const term of concluded) {
    const { values } = variable.terms[term];
    let place = 0;
    for (let i = 0; i < points.length; i++) {
      while (place + 1 < grid.length && grid[place + 1] <= points[i]) place++;
      const height = Math.min(cuts[term], interpolate(points[i], grid, values, place));
      if (height > heights[i]) heights[i] = height;
    }
  }
  return [points, heights];
}

/** Whether the terms of an output are cut, and the highest of them counts. */
function isCut({ implication, aggregation }) {
  return implication === "min" && aggregation === "max";
}

/** What each rule implies, aggregated one after the other at the universe's points: [points, heights]. */
function aggregateByRule(system, output, firing) {
  const variable = system.outputs[output];
  const imply = AND_OPERATORS[variable.implication];
  const join = AGGREGATIONS[variable.aggregation];
  const points = isSampled(system) ? variable.points : variable.universe;
  const heights = new Float64Array(points.length);
  system.rules.forEach((rule, index) => {
    for (const [concluded, term, weight] of rule.consequents) {
      if (concluded !== output) continue;
      const values = isSampled(system) ? variable.terms[term].sampled : variable.terms[term].values;
      const strength = firing[index] * weight;
      for (let i = 0; i < heights.length; i++) heights[i] = join(heights[i], imply(strength, values[i]));
    }
  });
  return [points, heights];
}

/** The centre of area of a polygon, summed segment by segment. */
function centroid(x, y) {
  let moment = 0;
  let area = 0;
  for (let i = 0; i + 1 < x.length; i++) {
    const [y1, y2] = [y[i], y[i + 1]];
    if (y1 === 0 && y2 === 0) continue;
    const width = x[i + 1] - x[i];
    let centre;
    let segment;
    if (y1 === y2) {
      centre = 0.5 * (x[i] + x[i + 1]);
      segment = width * y1;
    } else if (y1 === 0) {
      centre = (2 / 3) * width + x[i];
      segment = 0.5 * width * y2;
    } else if (y2 === 0) {
      centre = (1 / 3) * width + x[i];
      segment = 0.5 * width * y1;
    } else {
      centre = ((2 / 3) * width * (y2 + 0.5 * y1)) / (y1 + y2) + x[i];
      segment = 0.5 * width * (y1 + y2);
    }
    moment += centre * segment;
    area += segment;
  }
  return moment / Math.max(area, SMALLEST_AREA);
}

/** Where half of the area lies on either side, as scikit-fuzzy takes it where the polygon has a gap. */
function bisector(x, y) {
  const areas = new Float64Array(x.length - 1);
  let total = 0;
  for (let i = 0; i + 1 < x.length; i++) {
    if (y[i] === 0 && y[i + 1] === 0) continue;
    if (y[i] === y[i + 1]) total += (x[i + 1] - x[i]) * y[i];
    else total += 0.5 * (x[i + 1] - x[i]) * (y[i] + y[i + 1]);
    areas[i] = total;
  }
  const i = areas.findIndex((area) => area >= total / 2);
  const rest = total / 2 - (i > 0 ? areas[i - 1] : 0);
  const [x1, x2, y1, y2] = [x[i], x[i + 1], y[i], y[i + 1]];
  if (y1 === y2) return rest / y1 + x1;
  if (y1 === 0) return x1 + Math.sqrt((2 * rest * (x2 - x1)) / y2);
  if (y2 === 0) return x2 - Math.sqrt((x2 - x1) * (x2 - x1) - (2 * rest * (x2 - x1)) / y1);
  const slope = (y2 - y1) / (x2 - x1);
  return x1 - (y1 - Math.sqrt(y1 * y1 + 2 * slope * rest)) / slope;
}

/** The points where a polygon is highest. */
function highest(x, y) {
  const height = y.reduce((a, b) => Math.max(a, b));
  return x.filter((_, i) => y[i] === height);
}

const DEFUZZIFIERS = {
  centroid,
  bisector,
  mom: (x, y) => {
    const points = highest(x, y);
    return points.reduce((a, b) => a + b, 0) / points.length;
  },
  som: (x, y) => highest(x, y)[0],
  lom: (x, y) => highest(x, y).at(-1),
};

/** The centre of points, weighted by heights. */
function sampledCentroid(x, y) {
  let [area, moment] = [0, 0];
  for (let i = 0; i < x.length; i++) {
    area += y[i];
    moment += x[i] * y[i];
  }
  return Math.min(Math.max(moment / area, x[0]), x.at(-1));
}

/** Where half of the sum lies on either side, as each program finds it; see fis_tools/engines/sampling.py. */
const BISECTORS = {
  matlab: (x, y) => {
    const half = y.reduce((a, b) => a + b, 0) / 2;
    let running = 0;
    return x.find((_, i) => (running += y[i]) >= half * (1 - TIE)) ?? x.at(-1);
  },
  fuzzylite: (x, y) => {
    const total = y.reduce((a, b) => a + b, 0);
    let running = 0;
    const distances = Array.from(y, (height) => Math.abs((running += height) / total - 0.5));
    const nearest = Math.min(...distances);
    const points = x.filter((_, i) => distances[i] <= nearest + TIE);
    return points.reduce((a, b) => a + b, 0) / points.length;
  },
  fcl: (x, y) => {
    let [low, high, sumLow, sumHigh] = [0, x.length - 1, 0, 0];
    while (low < high) {
      if (sumLow <= sumHigh * (1 + TIE)) sumLow += y[++low];
      else sumHigh += y[--high];
    }
    return sumLow > 0 ? Math.min(x[0] + (x[1] - x[0]) * low, x.at(-1)) : NaN;
  },
};

/** What a program makes of heights at points; NaN where it finds no number. Faint heights are raised first. */
function defuzzifySampled({ semantics }, method, x, heights) {
  const isFaint = heights.reduce((a, b) => Math.max(a, b)) < 1e-200;
  const y = isFaint ? heights.map((height) => height * 2 ** 600) : heights;
  if (method === "centroid") return sampledCentroid(x, y);
  if (method === "bisector") return BISECTORS[semantics](x, y);
  const top = y.reduce((a, b) => Math.max(a, b)) * (1 - TIE);
  const points = x.filter((_, i) => y[i] >= top);
  if (method === "mom") return points.reduce((a, b) => a + b, 0) / points.length;
  const sign = method === "som" ? 1 : -1;
  const size = semantics === "matlab" ? Math.abs : (value) => value;
  return points.reduce((a, b) => (sign * size(b) < sign * size(a) ? b : a));
}

/** What the rules conclude on one output: cuts, the aggregated polygon, and the number it becomes. */
function conclude(system, output, firing) {
  const variable = system.outputs[output];
  const cuts = cutTerms(system, output, firing);
  const isPolygon = isCut(variable) && !isSampled(system);
  const [points, heights] = isPolygon ? aggregate(variable, cuts) : aggregateByRule(system, output, firing);
  const fires = heights.some((height) => height !== 0);
  const silent = variable.default ?? (isSampled(system) ? NaN : 0);
  const defuzzify = isSampled(system)
    ? defuzzifySampled.bind(null, system, variable.defuzzifier)
    : DEFUZZIFIERS[variable.defuzzifier];
  const value = fires ? defuzzify(points, heights) : silent;
  const isDefault = !fires || (isSampled(system) && Number.isNaN(value));
  return { cuts, points, heights, value: isDefault ? silent : value, isDefault };
}

/** All steps of one inference. */
function infer(system, inputs) {
  const clipped = clipInputs(system, inputs);
  const memberships = fuzzify(system, clipped);
  const firing = fire(system, memberships);
  const outputs = system.outputs.map((_, output) => conclude(system, output, firing));
  return { clipped, memberships, firing, outputs };
}

/** One output alone, as a number. */
function evaluate(system, inputs, output) {
  const firing = fire(system, fuzzify(system, clipInputs(system, inputs)));
  return conclude(system, output, firing).value;
}

/** What each rule that fires moved an output by: the output less what it were had the rule been silent. */
function contributions(system, output, { firing, outputs }) {
  const { cuts, value } = outputs[output];
  const variable = system.outputs[output];
  const isByMaximum = isCut(variable) && variable.accumulation === "max";
  return firing.map((strength, rule) => {
    // under a maximum only a rule that cuts its term highest can matter
    const matters = ([concluded, term, weight]) =>
      concluded === output && (!isByMaximum || strength * weight >= cuts[term]);
    if (strength === 0 || !system.rules[rule].consequents.some(matters)) return 0;
    return value - conclude(system, output, firing.with(rule, 0)).value;
  });
}

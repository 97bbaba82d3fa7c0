// Mamdani inference, step by step: what combines degrees, aggregates and defuzzifies is in TRANSCRIBED, written
// from what Python runs.

const { FUZZY, SHAPES, DEFUZZIFIERS } = TRANSCRIBED;

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

/** How far a value, which may lie outside of the range, belongs to a term. */
function degreeAt(x, { shape, numbers, points, heights }) {
  const { counted, degreeTable } = TRANSCRIBED;
  return counted(shape in SHAPES ? SHAPES[shape](x, ...numbers) : degreeTable(points, heights, x));
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
  if (kind !== "and" && kind !== "or") return FUZZY[kind](degree(rule, operand, memberships));
  const combine = FUZZY[kind === "and" ? rule.and_operator : rule.or_operator];
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
  const accumulate = FUZZY[system.outputs[output].accumulation];
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

/** What the aggregation of a variable works in, which is made once: shares infer thousands of times. */
const rooms = new WeakMap();

/** The highest of the cut terms, at the universe's points and at the crossings: [points, heights]. */
function aggregate({ universe, terms, runs }, cuts) {
  const concluded = terms.map((_, term) => term).filter((term) => !Number.isNaN(cuts[term]));
  const memberships = concluded.map((term) => terms[term].values);
  if (!rooms.has(universe)) rooms.set(universe, Array.from({ length: 4 }, () => new Float64Array(universe.length + runs.length)));
  const [heights, crossings, x, y] = rooms.get(universe);
  const held = concluded.map((term) => cuts[term]);
  const count = TRANSCRIBED.aggregate(universe, memberships, runs, held, heights, crossings, x, y);
  return [x.slice(0, count), y.slice(0, count)];
}

/** Whether the terms of an output are cut, and the highest of them counts. */
function isCut({ implication, aggregation }) {
  return implication === "min" && aggregation === "max";
}

/** What each rule implies, aggregated one after the other at the universe's points: [points, heights]. */
function aggregateByRule(system, output, firing) {
  const variable = system.outputs[output];
  const [imply, join] = [FUZZY[variable.implication], FUZZY[variable.aggregation]];
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

/** The number that heights at points become, some of which are positive; NaN where there is none. */
function defuzzify(system, output, points, heights) {
  const method = system.outputs[output].defuzzifier;
  if (!isSampled(system)) return DEFUZZIFIERS[method](points, heights, points.length, NaN);
  // it may raise faint heights: those that are shown stay
  return DEFUZZIFIERS[`sampled_${system.semantics}_${method}`](points, heights.slice(), NaN);
}

/** What the rules conclude on one output: cuts, the aggregated polygon, and the number it becomes. */
function conclude(system, output, firing) {
  const variable = system.outputs[output];
  const cuts = cutTerms(system, output, firing);
  const isPolygon = isCut(variable) && !isSampled(system);
  const [points, heights] = isPolygon ? aggregate(variable, cuts) : aggregateByRule(system, output, firing);
  const fires = heights.some((height) => height !== 0);
  const silent = variable.default ?? (isSampled(system) ? NaN : 0);
  const value = fires ? defuzzify(system, output, points, heights) : silent;
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

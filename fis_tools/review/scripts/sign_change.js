// The smallest change of one input that turns the sign of an output, as fis_tools/explanation/flips.py finds it.

const MOST_STEPS = 8;
const FINE_POINTS = 800;
const BISECTIONS = 40;

/** The sign of an output: zero for what is nothing against its range. */
function signOf(variable, value) {
  return Math.abs(value) < 1e-12 * (variable.maximum - variable.minimum) ? 0 : Math.sign(value);
}

/** The values of an input that are looked at: steps between the points of its universe, fewer where it is fine. */
function placesToLook({ universe }) {
  const gaps = universe.length - 1;
  const steps = Math.min(Math.max(Math.round(FINE_POINTS / gaps), 1), MOST_STEPS);
  const places = [];
  for (let i = 0; i < gaps; i++) {
    for (let step = 0; step < steps; step++) {
      places.push(universe[i] + ((universe[i + 1] - universe[i]) * step) / steps);
    }
  }
  places.push(universe[gaps]);
  return places;
}

/** Halve the way between a value before the turn and one after it; return the one after. */
function locate(isTurned, before, after) {
  for (let halving = 0; halving < BISECTIONS; halving++) {
    const middle = (before + after) / 2;
    if (isTurned(middle)) after = middle;
    else before = middle;
  }
  return after;
}

/**
 * Search each input both ways for the nearest value where the output has the other sign.
 * Returns the input, the value and the change of the one that changes least in parts of its range, or null.
 */
function signChange(system, inputs, output) {
  const variable = system.outputs[output];
  const start = clipInputs(system, inputs);
  const sign = signOf(variable, evaluate(system, start, output));
  if (sign === 0) return null;
  let best = null;
  system.inputs.forEach((asked, input) => {
    const isTurned = (value) => signOf(variable, evaluate(system, start.with(input, value), output)) === -sign;
    const range = asked.maximum - asked.minimum;
    const places = placesToLook(asked);
    const above = places.filter((value) => value > start[input]);
    const below = places.filter((value) => value < start[input]).reverse();
    for (const way of [above, below]) {
      let before = start[input];
      for (const value of way) {
        if (best && Math.abs(before - inputs[input]) / range >= best.share) break;
        if (isTurned(value)) {
          const at = locate(isTurned, before, value);
          const by = at - inputs[input];
          const share = Math.abs(by) / range;
          if (!best || share < best.share) best = { input, at, by, share };
          break;
        }
        before = value;
      }
    }
  });
  return best;
}

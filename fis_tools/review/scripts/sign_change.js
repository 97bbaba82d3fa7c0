// The smallest change of one input that turns the sign of an output.

const SCAN_POINTS = 200;
const BISECTIONS = 40;

/** The sign of an output: zero for what is nothing against its range. */
function signOf(variable, value) {
  return Math.abs(value) < 1e-12 * (variable.maximum - variable.minimum) ? 0 : Math.sign(value);
}

/** Follow one input from where it stands to one end of its range; return where the sign has turned, or null. */
function turnTowards(system, inputs, output, input, end) {
  const signAt = (value) => signOf(system.outputs[output], evaluate(system, inputs.with(input, value), output));
  const { minimum, maximum } = system.inputs[input];
  const start = Math.min(Math.max(inputs[input], minimum), maximum);
  const sign = signAt(start);
  const count = Math.ceil((SCAN_POINTS * Math.abs(end - start)) / (maximum - minimum));
  let before = start;
  for (let i = 1; i <= count; i++) {
    let after = i === count ? end : start + ((end - start) * i) / count;
    if (signAt(after) === -sign) {
      for (let halving = 0; halving < BISECTIONS; halving++) {
        const middle = (before + after) / 2;
        if (signAt(middle) === -sign) after = middle;
        else before = middle;
      }
      return after;
    }
    before = after;
  }
  return null;
}

/**
 * Search each input in steps of a 200th of its range for the nearest value that turns the output's sign.
 * Returns the input, the value and the change of the one that changes least in parts of its range, or null.
 */
function signChange(system, inputs, output) {
  if (signOf(system.outputs[output], evaluate(system, inputs, output)) === 0) return null;
  let best = null;
  system.inputs.forEach(({ minimum, maximum }, input) => {
    for (const end of [minimum, maximum]) {
      const at = turnTowards(system, inputs, output, input, end);
      if (at === null) continue;
      const by = at - inputs[input];
      const share = Math.abs(by) / (maximum - minimum);
      if (!best || share < best.share) best = { input, at, by, share };
    }
  });
  return best;
}

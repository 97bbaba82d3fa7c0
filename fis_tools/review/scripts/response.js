// An output over a grid of two inputs, the others held; and lines of equal height on it.

const GRID_POINTS = 49;

/** A variable of which only a part of the range is shown. */
function partOf(variable, part) {
  const [minimum, maximum] = part.of(variable.minimum, variable.maximum);
  return { ...variable, minimum, maximum };
}

/** Evaluate an output over parts of two inputs: points along both, and values a row of x for each y. */
function responseOver(state, xInput, yInput, output, parts, count = GRID_POINTS) {
  const { system } = state;
  const [xVariable, yVariable] = [xInput, yInput].map((input, axis) => partOf(system.inputs[input], parts[axis]));
  const x = spaced(xVariable.minimum, xVariable.maximum, count);
  const y = spaced(yVariable.minimum, yVariable.maximum, count);
  const inputs = [...state.inputs];
  const values = y.map((along) => {
    inputs[yInput] = along;
    return x.map((across) => {
      inputs[xInput] = across;
      return evaluate(system, inputs, output);
    });
  });
  const [low, high] = extremes(values.flat());
  return { xVariable, yVariable, variable: system.outputs[output], x, y, values, low, high };
}

/** Where along an edge a level is crossed, or null. */
function crossed(a, b, level) {
  return a < level === b < level ? null : (level - a) / (b - a);
}

/** The segments of a line of equal height in one cell of a grid, in parts of the cell: [[x1, y1, x2, y2], …]. */
function contourInCell([bottomLeft, bottomRight, topRight, topLeft], level) {
  const cuts = [];
  const along = [
    [crossed(bottomLeft, bottomRight, level), (t) => [t, 0]],
    [crossed(bottomRight, topRight, level), (t) => [1, t]],
    [crossed(topLeft, topRight, level), (t) => [t, 1]],
    [crossed(bottomLeft, topLeft, level), (t) => [0, t]],
  ];
  for (const [part, point] of along) if (part !== null) cuts.push(point(part));
  const segments = [];
  for (let i = 0; i + 1 < cuts.length; i += 2) segments.push([...cuts[i], ...cuts[i + 1]]);
  return segments;
}

/** The corners of a cell, counter-clockwise from the lower left. */
function cornersOf(values, row, column) {
  return [values[row][column], values[row][column + 1], values[row + 1][column + 1], values[row + 1][column]];
}

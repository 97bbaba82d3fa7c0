// Membership functions of one variable, as a drawing.

const CHART = { width: 360, left: 28, right: 350, plotHeight: 104, rowHeight: 14, foot: 40 };
const LETTER_WIDTH = 6.7;

/** Where a term is highest: the middle of its top. */
function peakOf(universe, values) {
  const top = values.reduce((a, b) => Math.max(a, b));
  const places = universe.filter((_, i) => values[i] === top);
  return (places[0] + places.at(-1)) / 2;
}

/** Put labels in as few rows as keep them apart; return each one's row and middle. */
function stagger(labels) {
  const ends = [];
  const order = labels.map((_, i) => i).sort((a, b) => labels[a].x - labels[b].x);
  const placed = [];
  for (const index of order) {
    const half = (labels[index].text.length * LETTER_WIDTH) / 2;
    const middle = Math.min(Math.max(labels[index].x, half + 2), CHART.width - half - 2);
    let row = ends.findIndex((end) => end + 6 <= middle - half);
    if (row < 0) row = ends.length;
    ends[row] = middle + half;
    placed[index] = { row, middle };
  }
  return { placed, numRows: ends.length };
}

function pathThrough(xs, ys, x, y) {
  const points = Array.from(xs, (value, i) => `${x(value).toFixed(2)} ${y(ys[i]).toFixed(2)}`);
  return `M${points.join("L")}`;
}

/** The area under a function over a variable's universe, as a path. */
function areaUnder(xs, ys, x, y) {
  const base = y(0).toFixed(2);
  return `${pathThrough(xs, ys, x, y)}L${x(xs.at(-1)).toFixed(2)} ${base}L${x(xs[0]).toFixed(2)} ${base}Z`;
}

function chartAxes(variable, x, y) {
  const parts = [];
  for (const value of [0, 0.5, 1]) {
    parts.push(draw("line", { class: "grid", x1: CHART.left, x2: CHART.right, y1: y(value), y2: y(value) }));
    const beside = { class: "tick", x: CHART.left - 5, y: y(value) + 3.5, "text-anchor": "end" };
    parts.push(draw("text", beside, shown(value)));
  }
  for (const value of ticks(variable.minimum, variable.maximum, 5)) {
    parts.push(draw("line", { class: "axis", x1: x(value), x2: x(value), y1: y(0), y2: y(0) + 4 }));
    parts.push(draw("text", { class: "tick", x: x(value), y: y(0) + 16, "text-anchor": "middle" }, shown(value)));
  }
  const title = { class: "axis-title", x: (CHART.left + CHART.right) / 2, y: y(0) + 32, "text-anchor": "middle" };
  const words = withUnit(variable);
  const room = CHART.right - CHART.left;
  const fit = words.length * LETTER_WIDTH > room ? { textLength: room, lengthAdjust: "spacingAndGlyphs" } : {};
  parts.push(draw("text", { ...title, ...fit }, words));
  return parts;
}

/**
 * Draw a variable's terms, each with its name over its top.
 * `under` and `over` are layers for what else belongs there; `x` and `y` map values into the drawing.
 */
function membershipChart(variable, description, plotHeight = CHART.plotHeight) {
  const x = linear(variable.minimum, variable.maximum, CHART.left, CHART.right);
  const labels = variable.terms.map((term) => ({ text: term.name, x: x(peakOf(variable.universe, term.values)) }));
  const { placed, numRows } = stagger(labels);
  const top = numRows * CHART.rowHeight + 8;
  const y = linear(0, 1, top + plotHeight, top);
  const under = draw("g");
  const over = draw("g");
  const curves = variable.terms.map((term, i) =>
    draw("path", { class: `curve term-${i % 7}`, d: pathThrough(variable.universe, term.values, x, y) }),
  );
  const names = labels.flatMap((label, i) => {
    const middle = { "text-anchor": "middle" };
    const baseline = top - 6 - placed[i].row * CHART.rowHeight;
    return [
      draw("line", { class: "leader", x1: placed[i].middle, x2: label.x, y1: baseline + 3, y2: top }),
      draw("text", { ...middle, class: `name term-${i % 7}`, x: placed[i].middle, y: baseline }, label.text),
    ];
  });
  const height = top + plotHeight + CHART.foot;
  const svg = draw(
    "svg",
    { viewBox: `0 0 ${CHART.width} ${height}`, role: "img", "aria-label": description, class: "chart" },
    ...chartAxes(variable, x, y),
    under,
    ...curves,
    over,
    ...names,
  );
  const valueAt = ({ clientX }) => {
    const { left, width } = svg.getBoundingClientRect();
    const value = linear(CHART.left, CHART.right, variable.minimum, variable.maximum)(((clientX - left) / width) * CHART.width);
    return Math.min(Math.max(value, variable.minimum), variable.maximum);
  };
  tellUnder(svg, (event) => {
    const value = valueAt(event);
    const place = placeIn(variable.universe, value);
    const memberships = variable.terms.map(({ values }) => interpolate(value, variable.universe, values, place));
    return `${quantity(value, variable, 3)}: ${membershipWords(variable, memberships)}`;
  });
  return { svg, under, over, x, y, valueAt };
}

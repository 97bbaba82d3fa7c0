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

let numCharts = 0;

/** The names of terms, each over its top, those that are not shown left out. */
function chartNames(variable, { minimum, maximum }, x, top) {
  const labels = variable.terms
    .map((term, i) => ({ text: term.name, peak: peakOf(variable.universe, term.values), term: i }))
    .filter(({ peak }) => peak >= minimum && peak <= maximum)
    .map((label) => ({ ...label, x: x(label.peak) }));
  const { placed, numRows } = stagger(labels);
  const drawn = labels.flatMap((label, i) => {
    const baseline = top - 6 - placed[i].row * CHART.rowHeight;
    const middle = { "text-anchor": "middle", class: `name term-${label.term % 7}` };
    return [
      draw("line", { class: "leader", x1: placed[i].middle, x2: label.x, y1: baseline + 3, y2: top }),
      draw("text", { ...middle, x: placed[i].middle, y: baseline }, label.text),
    ];
  });
  return { drawn, numRows };
}

/**
 * Draw a variable's terms, each with its name over its top; it zooms along the variable, and then calls `changed`.
 * `under` and `over` are layers for what else belongs there; `x` and `y` map values into the drawing as it is shown.
 */
function membershipChart(variable, description, plotHeight = CHART.plotHeight, changed = () => {}) {
  const part = new Part();
  const clip = `chart-${numCharts}`;
  numCharts += 1;
  const whole = linear(variable.minimum, variable.maximum, CHART.left, CHART.right);
  const top = chartNames(variable, variable, whole, 0).numRows * CHART.rowHeight + 8;
  const height = top + plotHeight + CHART.foot;
  const [axes, under, curves, over, names] = Array.from({ length: 5 }, () => draw("g"));
  const room = { x: CHART.left, y: 0, width: CHART.right - CHART.left, height };
  const svg = draw(
    "svg",
    {
      viewBox: `0 0 ${CHART.width} ${height}`,
      role: "img",
      tabindex: "0",
      "aria-label": `${description}; + and − zoom, 0 shows all`,
      class: "chart",
    },
    draw("clipPath", { id: clip }, draw("rect", room)),
    axes,
    draw("g", { "clip-path": `url(#${clip})` }, under, curves, over),
    names,
  );
  const chart = { svg, under, over, x: whole, y: linear(0, 1, top + plotHeight, top) };
  const paint = () => {
    const shownPart = partOf(variable, part);
    const { x, y } = Object.assign(chart, {
      x: linear(shownPart.minimum, shownPart.maximum, CHART.left, CHART.right),
    });
    axes.replaceChildren(...chartAxes(shownPart, x, y));
    const curveOf = ({ values }, i) =>
      draw("path", { class: `curve term-${i % 7}`, d: pathThrough(variable.universe, values, x, y) });
    curves.replaceChildren(...variable.terms.map(curveOf));
    names.replaceChildren(...chartNames(variable, shownPart, x, top).drawn);
  };
  const placeOf = ({ clientX }) => {
    const { left, width } = svg.getBoundingClientRect();
    return linear(CHART.left, CHART.right, 0, 1)(((clientX - left) / width) * CHART.width);
  };
  chart.valueAt = (event) => {
    const [low, high] = part.of(variable.minimum, variable.maximum);
    return low + Math.min(Math.max(placeOf(event), 0), 1) * (high - low);
  };
  tellUnder(svg, (event) => {
    const value = chart.valueAt(event);
    const place = placeIn(variable.universe, value);
    const memberships = variable.terms.map(({ values }) => interpolate(value, variable.universe, values, place));
    return `${quantity(value, variable, 3)}: ${membershipWords(variable, memberships)}`;
  });
  const repaint = () => {
    paint();
    changed();
  };
  chart.zooming = makeZoomable(svg, [part], (event) => [placeOf(event)], repaint, `the terms of ${variable.name}`);
  paint();
  return chart;
}

// Quantities of a flight over time, all along one axis, with a cursor at the moment that the page shows.

const PLOT = { height: 170, left: 46, right: 12, top: 22, bottom: 26 };
const STEPS = { ArrowLeft: -1, ArrowRight: 1, PageUp: -30, PageDown: 30, Home: -Infinity, End: Infinity };

/** The axes of a plot of so many minutes: lines and words. */
function plotAxes(x, y, most, minutes, width) {
  const { height, left, right, top, bottom } = PLOT, floor = height - bottom;
  return [
    ...ticks(0, most, 3).flatMap(value => [
      draw("line", { x1: left, x2: width - right, y1: y(value), y2: y(value), stroke: "var(--grid)", "stroke-width": 0.7 }),
      draw("text", { x: left - 5, y: y(value) + 4, "text-anchor": "end" }, shown(value)),
    ]),
    ...ticks(0, minutes, width < 420 ? 4 : 6).map(minute => draw("text", { x: x(minute), y: height - 8, "text-anchor": "middle" }, `${minute}${minute ? "" : " min"}`)),
    draw("line", { x1: left, x2: left, y1: top, y2: floor, stroke: "var(--grid)" }),
  ];
}

/** What follows the end, and the limits. */
function plotMarks(x, y, { limits, unit, after, end, width }) {
  const { height, left, right, top, bottom } = PLOT;
  return [
    ...(after ? [
      draw("rect", { x: x(end), y: top, width: x(end + after) - x(end), height: height - bottom - top, fill: "var(--grid)", opacity: 0.35 }),
      draw("text", { x: width - right, y: top - 9, "text-anchor": "end" }, "after the end"),
    ] : []),
    ...limits.flatMap(limit => [
      draw("line", { x1: left, x2: width - right, y1: y(limit), y2: y(limit), stroke: "var(--push)", "stroke-dasharray": "3 4" }),
      draw("text", { x: left + 5, y: y(limit) - 3, style: "fill:var(--push)" }, `limit ${limit} ${unit}`),
    ]),
  ];
}

/**
 * A plot of a flight: `lines` are {name, values, first, dash}, a value a sample from sample `first` on.
 *
 * `highest` is what the axis holds, that of all flights beside each other. `go(k)` moves the page's time; returned is what
 * shows a sample.
 */
function timePlot(box, title, { lines, limits = [], unit, decimals, flight, after = 0, fileName, highest }, go) {
  const width = Math.max(260, box.clientWidth - 26), period = flight.periodS / 60, end = (flight.numSamples - 1) * period;
  const most = 1.06 * Math.max(1e-9, ...limits, highest);
  const { height, left, right, top, bottom } = PLOT;
  const x = linear(0, end + after, left, width - right), y = linear(0, most, height - bottom, top);
  const drawing = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "slider", tabindex: 0, "aria-label": `Time, over ${title}${flight.of}`, "aria-valuemin": 0, "aria-valuemax": flight.numSamples - 1, "aria-valuenow": 0 },
    ...plotAxes(x, y, most, end + after, width), ...plotMarks(x, y, { limits, unit, after, end, width }));
  for (const { values, first = 0, dash = "" } of lines) {
    const points = Array.from(values, (value, i) => `${x((first + i) * period).toFixed(1)},${y(value).toFixed(1)}`).join(" ");
    drawing.append(draw("polyline", { fill: "none", stroke: "var(--ink)", "stroke-width": 1.7, "stroke-dasharray": dash, points }));
  }
  const cursor = draw("line", { y1: top, y2: height - bottom, stroke: "var(--accent)", "stroke-width": 2 });
  const dot = draw("circle", { r: 4, fill: "var(--accent)" }), word = draw("text", { y: top - 9, class: "now" }); // above all lines and limits
  drawing.append(cursor, dot, word);
  let now = 0;
  const sampleAt = event => {
    const { left: start, width: wide } = drawing.getBoundingClientRect();
    return Math.round(linear(left, width - right, 0, end + after)((event.clientX - start) / wide * width) / period);
  };
  drawing.addEventListener("pointerdown", event => { drawing.setPointerCapture(event.pointerId); go(sampleAt(event)); });
  drawing.addEventListener("pointermove", event => { if (event.buttons) go(sampleAt(event)); });
  drawing.addEventListener("keydown", event => {
    const step = STEPS[event.key];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    go(Math.min(Math.max(now + step, 0), flight.numSamples - 1));
  });
  const columns = () => {
    const count = Math.max(...lines.map(({ values, first = 0 }) => first + values.length));
    const of = ({ values, first = 0 }) => Array.from({ length: count }, (_, k) => values[k - first] ?? "");
    return [["time_s", Array.from({ length: count }, (_, k) => k * flight.periodS)], ...lines.map(line => [line.name, of(line)])];
  };
  box.replaceChildren(savingButtons(title, fileName, () => drawing, columns), make("h4", {}, title), drawing);
  return k => {
    now = k;
    const value = lines[0].values[k], at = x(k * period), isRight = at > (after ? x(end) - 70 : width - 110);
    Object.entries({ x1: at, x2: at }).forEach(([name, place]) => cursor.setAttribute(name, place));
    dot.setAttribute("cx", at);
    dot.setAttribute("cy", y(value));
    word.setAttribute("x", at + (isRight ? -6 : 6));
    word.setAttribute("text-anchor", isRight ? "end" : "start");
    word.textContent = `${value.toFixed(decimals)} ${unit}`.trim();
    drawing.setAttribute("aria-valuenow", k);
    drawing.setAttribute("aria-valuetext", `${clockWords(k * flight.periodS)}, ${word.textContent}`);
  };
}

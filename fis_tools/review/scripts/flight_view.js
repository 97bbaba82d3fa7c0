// What a system did along a flight or a table, which the page calls a log: its output, which rules fired, and the moment that all views show.

const MOST_ROWS = 8;
const FIRED = 0.05;
const PLAYED = "the flight that plays, every decision";
const STRIP = { left: 64, right: 14, top: 10, output: 66, gap: 8, row: 11, foot: 36 };

/** The flight and the time that all systems of the page show together. */
class FlightClock {
  constructor(flights, noun) {
    this.flights = flights;
    this.noun = noun;
    this.flight = 0;
    this.time = 0;
    this.listeners = [];
  }

  set(flight, time) {
    this.flight = flight;
    this.time = time;
    this.listeners.forEach((listener) => listener());
  }

  /** Set what is shown, and let a player of the page show it too. */
  choose(flight, time) {
    this.set(flight, time);
    document.dispatchEvent(new CustomEvent("sought", { detail: { number: caseIn(this.flights[flight].name), time } }));
  }

  /**
   * Follow a player of the page: the flight that it plays is one of the flights, and has its time.
   *
   * It tells `played`, with a case's number, if it is one, and, by system, the times and inputs of its decisions, and `moved`, with
   * a time.
   */
  followPlayer() {
    const played = { name: PLAYED, systems: [], count: 0 };
    this.flights.push(played);
    document.addEventListener("played", ({ detail: { number, systems, time } }) => {
      Object.assign(played, { systems, count: played.count + 1 });
      const isOf = ({ name }) => number !== undefined && caseIn(name) === number;
      const recorded = isOf(this.flights[this.flight]) ? this.flight : this.flights.findIndex(isOf);
      this.set(recorded >= 0 ? recorded : this.flights.indexOf(played), time);
    });
    document.addEventListener("moved", ({ detail: { time } }) => {
      if (time !== this.time) this.set(this.flight, time);
    });
  }

  follow(listener) {
    this.listeners.push(listener);
    listener();
  }
}

/** The number of the case that a flight's name ends with, beside which deputy of a fleet it is; null without one. */
function caseIn(name) {
  const digits = name.match(/case-(\d+)(-deputy-\d+)?$/)?.[1];
  return digits ? Number(digits) : null;
}

/** Infer a whole flight: its output and firing strengths, a row a sample. */
function inferFlight(system, flown) {
  const firing = flown.inputs.map((row) => fire(system, fuzzify(system, clipInputs(system, row))));
  const outputs = firing.map((strengths) => conclude(system, 0, strengths).value);
  const often = (rule) => firing.filter((strengths) => strengths[rule] >= FIRED).length / firing.length;
  return { fired: Float64Array.from(system.rules, (_, rule) => often(rule)), ...flown, firing, outputs };
}

/** Which rules have a row: those that fire at all, by how often or by their number. */
function rowsOf(inferred, isByNumber) {
  const fired = Array.from(inferred.fired.keys()).filter((rule) => inferred.fired[rule] > 0);
  fired.sort((a, b) => inferred.fired[b] - inferred.fired[a] || a - b);
  const rows = fired.slice(0, MOST_ROWS);
  return { rows: isByNumber ? rows.sort((a, b) => a - b) : rows, left: fired.length - rows.length };
}

function stripHeight(numRows) {
  return STRIP.top + STRIP.output + STRIP.gap + numRows * STRIP.row + STRIP.foot;
}

function paintOutputOverTime(context, system, inferred, x, right, colours) {
  const [variable] = system.outputs;
  const { times, outputs } = inferred;
  const [low, high] = extremes(outputs);
  const room = high > low ? 0 : Math.abs(high) || 1;
  const y = linear(low - room, high + room, STRIP.top + STRIP.output, STRIP.top);
  context.lineWidth = 1;
  context.textAlign = "right";
  for (const value of ticks(low - room, high + room, 3)) {
    context.strokeStyle = value === 0 ? colours.muted : colours.grid;
    polygon(context, [[STRIP.left, y(value)], [right, y(value)]]);
    context.stroke();
    context.fillStyle = colours.muted;
    context.fillText(shown(value, 3), STRIP.left - 6, y(value) + 4);
  }
  context.fillStyle = colours.ink;
  turnedText(context, withUnit(variable), 12, STRIP.top + STRIP.output / 2);
  context.strokeStyle = colours.accent;
  context.lineWidth = 1.6;
  // each output holds until the next
  const steps = outputs.flatMap((value, i) => [[x(times[i]), y(outputs[Math.max(i - 1, 0)])], [x(times[i]), y(value)]]);
  polygon(context, steps);
  context.stroke();
}

function paintFiring(context, inferred, rows, x, right, scale, colours) {
  const top = STRIP.top + STRIP.output + STRIP.gap;
  const { times, firing } = inferred;
  rows.forEach((rule, place) => {
    const y = top + place * STRIP.row;
    times.forEach((time, i) => {
      context.fillStyle = rgb(scale(firing[i][rule]));
      const end = i + 1 < times.length ? x(times[i + 1]) : right;
      context.fillRect(x(time), y, end - x(time) + 0.6, STRIP.row - 1);
    });
    context.fillStyle = colours.muted;
    context.textAlign = "right";
    context.fillText(`rule ${rule + 1}`, STRIP.left - 6, y + 9);
  });
  return top + rows.length * STRIP.row;
}

function paintTimes(context, times, x, bottom, width, colours, axis) {
  context.textAlign = "center";
  context.fillStyle = colours.muted;
  for (const time of ticks(times[0], times.at(-1), 6)) {
    context.fillRect(x(time), bottom, 1, 4);
    context.fillText(shown(time, 6), x(time), bottom + 16);
  }
  context.fillStyle = colours.ink;
  context.fillText(axis, (STRIP.left + width - STRIP.right) / 2, bottom + 32);
}

/** The map from time to the canvas, and the times that are shown: each sample holds until the next. */
function timeScale(times, part, width) {
  const hold = times.length > 1 ? times.at(-1) - times.at(-2) : 1;
  const [start, end] = part.of(times[0], times.at(-1) + hold);
  return { x: linear(start, end, STRIP.left, width - STRIP.right), start, end };
}

/** Draw the output and the firing strengths over the part of the flight that is shown. */
function paintStrip(canvas, system, inferred, rows, scale, time, part) {
  const { context, width, height } = sharpContext(canvas);
  const colours = themeColours();
  const right = width - STRIP.right;
  const { x, start, end } = timeScale(inferred.times, part, width);
  const clip = (left) => {
    context.save();
    context.beginPath();
    context.rect(left, 0, right - left + 1, height);
    context.clip();
  };
  clip(0);
  paintOutputOverTime(context, system, inferred, x, right, colours);
  const bottom = paintFiring(context, inferred, rows, x, right, scale, colours);
  context.restore();
  paintTimes(context, [start, end], x, bottom, width, colours, inferred.isTimed ? "time (s)" : "row");
  clip(STRIP.left);
  context.strokeStyle = colours.mark;
  context.lineWidth = 2;
  polygon(context, [[x(time), STRIP.top], [x(time), bottom]]);
  context.stroke();
  context.restore();
}

/** What a strip shows under a place: the time, and the output or the rule of that row. */
function stripWordsAt(system, { inferred, rows }, time, y) {
  const sample = sampleAt(inferred.times, time);
  const place = Math.floor((y - STRIP.top - STRIP.output - STRIP.gap) / STRIP.row);
  const [variable] = system.outputs;
  const told =
    place >= 0 && place < rows.length
      ? `rule ${rows[place] + 1}: ${inferred.firing[sample][rows[place]].toFixed(2)}`
      : `${variable.name} = ${quantity(inferred.outputs[sample], variable)}`;
  return `${timeWords(inferred, sample)}, ${told}`;
}

/** A sample's time, or its row. */
function timeWords({ times, isTimed }, sample) {
  return isTimed ? `${shown(times[sample], 6)} s` : `row ${times[sample]}`;
}

/** The last sample that is not after a time; the first where all are. */
function sampleAt(times, time) {
  return Math.max(placeIn(times, time), 0);
}

function stripWords({ fired, times, numInferences }, left, noun) {
  const silent = fired.filter((share) => share === 0).length;
  return [
    `${silent} of ${fired.length} rules never fire at ${FIRED} or more on this ${noun}.`,
    times.length < numInferences ? `Of its ${numInferences} inferences ${times.length} are shown.` : "",
    left ? `The ${left === 1 ? "one that fires" : `${left} that fire`} least often ${left === 1 ? "has" : "have"} no row.` : "",
    "The brighter, the stronger. The time sets the inputs of every system.",
  ].filter(Boolean).join(" ");
}

/** Fill an element with what a system did along the flights. */
function flightView(element, state, place, clock, scale) {
  const { system } = state;
  const known = new Map();
  const inferredOf = (flight) => {
    const { systems, count = 0 } = clock.flights[flight], flown = systems[place];
    if (!flown) return null;
    if (known.get(flight)?.count !== count) known.set(flight, { ...inferFlight(system, flown), count });
    return known.get(flight);
  };
  const about = `Output of ${system.name} and firing of its rules over time`;
  const canvas = make("canvas", { class: "strip", role: "img", tabindex: "0", "aria-label": about });
  const part = new Part();
  const slider = make("input", { type: "range", min: "0", step: "1", "aria-label": `Time along the ${clock.noun}` });
  const now = make("output", { class: "number" });
  const note = make("p", { class: "note" });
  const points = make("p", { class: "pulls" });
  let isByNumber = false;
  let drawn = null;

  const paint = keepDrawn(canvas, () => {
    if (!drawn) return;
    paintStrip(canvas, system, drawn.inferred, drawn.rows, scale, drawn.inferred.times[drawn.sample], part);
  });
  const show = () => {
    const inferred = inferredOf(clock.flight);
    canvas.hidden = slider.hidden = now.hidden = inferred === null;
    points.textContent = "";
    if (inferred === null) {
      drawn = null;
      note.textContent = `${system.name} decided nothing on this ${clock.noun}.`;
      return;
    }
    const sample = sampleAt(inferred.times, clock.time);
    const { rows, left } = rowsOf(inferred, isByNumber);
    drawn = { inferred, rows, sample };
    canvas.style.height = `${stripHeight(rows.length)}px`;
    slider.max = String(inferred.times.length - 1);
    slider.value = String(sample);
    now.value = timeWords(inferred, sample);
    slider.setAttribute("aria-valuetext", now.value);
    note.textContent = stripWords(inferred, left, clock.noun);
    points.textContent = inferred.points[sample] ? `What points add: ${inferred.points[sample]}.` : "";
    state.setInputs(inferred.inputs[sample]);
    paint();
  };
  const timeAt = ({ offsetX }) => {
    const { times } = drawn.inferred;
    const { x, start, end } = timeScale(times, part, canvas.clientWidth);
    const time = linear(x(start), x(end), start, end)(offsetX);
    return Math.min(Math.max(time, times[0]), times.at(-1));
  };
  const goTo = (event) => {
    if (drawn && (event.type !== "pointermove" || event.buttons === 1)) clock.choose(clock.flight, timeAt(event));
  };
  const placeOf = ({ offsetX }) => [(offsetX - STRIP.left) / (canvas.clientWidth - STRIP.left - STRIP.right)];
  const zooming = makeZoomable(canvas, [part], placeOf, paint, `the time of ${system.name}`);
  tellUnder(canvas, (event) => (drawn ? stripWordsAt(system, drawn, timeAt(event), event.offsetY) : null));
  canvas.addEventListener("pointerdown", goTo);
  canvas.addEventListener("pointermove", goTo);
  slider.addEventListener("input", () => clock.choose(clock.flight, drawn.inferred.times[Number(slider.value)]));
  const names = clock.flights.map(({ name }) => name);
  const flights = choice(clock.noun === "flight" ? "Flight" : "Log", names, 0, (chosen) => clock.choose(chosen, clock.time));
  const orders = choice("Rules by", ["how often they fire", "their number"], 0, (chosen) => {
    isByNumber = chosen === 1;
    show();
  });
  const time = make("div", { class: "control time" }, make("span", {}, "Time"), now, slider);
  element.append(make("div", { class: "controls" }, flights.element, orders.element, time, zooming), canvas, note, points);
  clock.follow(() => {
    flights.select.value = String(clock.flight);
    show();
  });
}

// One run's flight: its scene, plots, points, bouts of pushes and rules, all at the moment that its page shows.

const AFTER_S = 1800; // how long free motion is plotted after the end

/** The rule with the largest share in a push, in words. */
function namedRule(systems, quadrature) {
  return (flight, k, axis) => {
    const index = systems.findIndex(({ axis: driven }) => driven === axis);
    const reason = flight.reason(k, axis);
    if (index < 0 || (reason !== "fired" && reason !== "clipped")) return `${capital(flight.words[reason])}.`;
    const system = systems[index], steps = infer(system, Array.from(flight.inputs(k, index, system.inputs.length)));
    const parts = shares(system, 0, steps, quadrature).values, sign = Math.sign(flight.force(k)[axis]);
    const best = parts.reduce((most, part, rule) => (part * sign > parts[most] * sign ? rule : most), 0);
    return `Rule ${best + 1} of ${system.name}: ${system.rules[best].words}.`;
  };
}

/** Which points face the Sun at a sample, wherever a chief that turns has them then. */
function litBy(flight) {
  let last, { points } = flight;
  return (k, j) => {
    if (k !== last) points = flight.pointsAt?.(last = k) ?? points;
    return facesSun(points[j], flight.sun(k));
  };
}

class Side {
  /**
   * `run` is one of a page's, `root` the element that shows it, `letter` its name beside others or nothing, `fleet`
   * has the index of the fleet that its deputy is of, and the letters of all its deputies.
   */
  constructor(run, page, root, { letter, fleet }) {
    Object.assign(this, { run, page, root, letter, fleet, panels: [], flight: null, view: null });
    this.part = name => root.querySelector(`.${name}`);
    this.systems = run.systems.map(system => ({ ...decodeSystem(system), axis: system.axis }));
    const quadrature = this.systems.length && { chances: decodeDoubles(page.quadrature[0]), weights: decodeDoubles(page.quadrature[1]) };
    const points = floatsOf(run.flight.points);
    this.shared = {
      ...run.flight, of: letter ? ` of ${letter}` : "", words: page.words, freeMotion: floatsOf(run.flight.freeMotion), attitude: floatsOf(run.flight.attitude ?? ""),
      numSystems: run.flight.numSystems, points: Array.from({ length: run.flight.numPoints }, (_, j) => three(points, j)),
      pushed: namedRule(this.systems, quadrature),
    };
    this.showNow = this.systems.map((system, index) => {
      const box = make("section", { class: "card" });
      this.part("inference").append(box);
      return systemNow(box, system, index);
    });
    this.part("scene canvas").setAttribute("aria-label", `${this.part("scene canvas").getAttribute("aria-label")}${letter ? ` This is ${letter}.` : ""}`);
  }

  /** Start the module that flies the run's cases, if it has one. */
  async begin() {
    const { module, snapshot, own, ends } = this.run;
    if (!module) return;
    if (ends) this.ends = new Int32Array((await planesOf(ends, 4)).buffer);
    this.ask = beginWorker(this.page.worker);
    const [content] = await Promise.all([inflated(own.content), this.ask({ module: this.page.modules[module], snapshot })]);
    this.own = new Uint8Array(content);
  }

  /** Where what a row has of its own is, or -1. */
  placeOf(row) {
    if (!this.ask) return -1;
    return this.run.own.rows ? this.run.own.rows.indexOf(row) : row;
  }

  canOpen(row) {
    return row in this.run.recorded || this.placeOf(row) >= 0;
  }

  /** What a worker needs to fly a row. */
  caseOf(row) {
    const { names, size } = this.run.own, place = this.placeOf(row), count = this.own.length / size;
    return { names, own: Uint8Array.from({ length: size }, (_, at) => this.own[at * count + place]) };
  }

  /** Return a row's flight: recorded with the page, or flown now. */
  async flightOf(row) {
    const recorded = this.run.recorded[row];
    if (recorded) {
      const { attitude, ...shared } = this.run.flight; // a recording has the chief's own
      const seenBy = recorded.seenBy && [...recorded.seenBy].map(deputy => this.fleet.letters[deputy - 1] ?? "none");
      const table = { ...shared, ...recorded }; // which may have free motion of its own
      return { ...recordedFlight({ ...table, coast: table.freeMotion }), seenBy, of: this.shared.of };
    }
    const flight = flownFlight(this.shared, await this.ask(this.caseOf(row)), this.run.reasons[row], this.ends?.[row]);
    if (this.run.flight.isPlain) flight.isLit = litBy(flight);
    else flight.tellsLight = false;
    return flight;
  }

  /** Why a row does not open here, and how it is flown. */
  refusal(number) {
    const { why, command } = this.run, { fleets } = this.page;
    return `${fleets.length > 1 ? `${LETTERS[this.fleet.index]}: case` : "Case"} ${number} is not part of this page: ${why}.${command ? ` This flies it: ${command.replace("CASE", number)}` : ""}`;
  }

  /** Take a flight; `lead` is the side whose time counts, this one or another, which `onSample` hears of. */
  take(flight, lead, onSample) {
    this.flight = flight;
    this.counts = Array.from({ length: flight.numSamples }, (_, k) => flight.numSeen(k));
    this.seenAt = flight.points.map((_, j) => { for (let k = 0; k < flight.numSamples; k++) if (flight.isSeen(k, j)) return k; return null; });
    if (this.view) this.view.replace(flight);
    else this.view = new FlightView(this.part("scene"), flight, lead === this ? { onSample } : { lead: lead.view });
    this.root.classList.toggle("follows", lead !== this);
  }

  /** The sample at a time of the page, s. */
  sampleAt(seconds) {
    return Math.min(Math.max(0, Math.round(seconds / this.flight.periodS)), this.flight.numSamples - 1);
  }

  /** What each system sensed when it decided: times, and inputs a row a decision; null of one that never did. */
  sensed() {
    const { flight } = this, decided = [];
    for (let k = 0; k < flight.numSamples - 1; k += flight.stride) if (flight.isDecided(k)) decided.push(k);
    return this.systems.map((system, index) => decided.length ? {
      times: decided.map(k => k * flight.periodS), inputs: decided.map(k => flight.inputs(k, index, system.inputs.length)),
      numInferences: decided.length, isTimed: true, points: [],
    } : null);
  }

  get distances() {
    return Array.from({ length: this.flight.numSamples }, (_, k) => Math.hypot(...this.flight.position(k)));
  }

  /** The greatest values that plots of several flights share their axes by. */
  extents() {
    const end = this.flight.numSamples - 1;
    return { distance: Math.max(...this.distances, ...this.freeDistances(end)), fuel: this.flight.spent(end) || 0, points: Math.max(1, ...this.counts) };
  }

  /** Draw what belongs to the flight as a whole; `outcome` is what its evaluation says, `go(seconds)` moves the time. */
  draw({ title, outcome, fileName, extents, go }) {
    const { flight } = this, { numSamples, periodS } = flight, end = numSamples - 1;
    const to = k => go(k * periodS), name = words => () => `${fileName}-${words}`;
    const far = this.distances, free = this.freeDistances(end), lines = [{ name: "distance_m", values: far }];
    if (free.length) lines.push({ name: "free_motion_m", values: free, first: end, dash: "5 4" });
    this.part("which").textContent = title;
    const points = flight.points.length ? `${this.counts[end]} of ${flight.points.length} points` : "";
    const isSpent = Number.isFinite(flight.spent(end));
    this.part("outcome").textContent = [isSpent ? `${flight.spent(end).toFixed(3)} m/s` : "", points, flight.seenBy ? `${flight.seenBy.filter(by => by === this.letter).length} seen first` : "", `${Math.min(...far).toFixed(1)} to ${Math.max(...far).toFixed(1)} m`, outcome].filter(Boolean).join(" · ");
    const all = value => Array.from({ length: numSamples }, (_, k) => value(k));
    this.panels = [
      timePlot(this.part("distance"), "Distance from the chief", { lines, limits: flight.limits, unit: "m", decimals: 1, flight, after: free.length ? AFTER_S / 60 : 0, fileName: name("distance"), highest: extents.distance }, to),
      ...(isSpent ? [timePlot(this.part("fuel"), "Δv spent", { lines: [{ name: "delta_v_m_s", values: all(flight.spent) }], unit: "m/s", decimals: 3, flight, fileName: name("fuel"), highest: extents.fuel }, to)] : []),
      ...(flight.points.length ? [
        timePlot(this.part("progress"), "Points inspected", { lines: [{ name: "points", values: this.counts }], unit: "", decimals: 0, flight, fileName: name("points"), highest: extents.points }, to),
        pointsMap(this.part("map"), flight, this.seenAt, to, name("map")),
      ] : []),
      boutsList(this.part("events"), flight, to),
      ...this.showNow.map(show => k => show(flight, k)),
    ];
    const key = flight.tellsLight === false ? { dark: "not inspected" } : { lit: "lit", dark: "dark" };
    this.part("key").replaceChildren(...Object.entries({ seen: "inspected", ...key }).flatMap(([name, words]) => [make("i", { class: name }), `${words} `]));
    for (const part of ["map", "progress", "key"]) this.part(part).hidden = !flight.points.length;
    this.part("fuel").hidden = !isSpent;
  }

  /** Distances of free motion after the end, a value a sample, as it is drawn in the scene. */
  freeDistances(end) {
    const path = this.flight.coast(end);
    if (!path) return [];
    const step = 2 * Math.PI / this.flight.meanMotion / (path.length - 1);
    return Array.from({ length: Math.floor(AFTER_S / this.flight.periodS) + 1 }, (_, i) => {
      const at = i * this.flight.periodS / step, before = Math.floor(at), share = at - before, next = path[Math.min(before + 1, path.length - 1)];
      return Math.hypot(...path[before].map((value, axis) => value + share * (next[axis] - value)));
    });
  }

  /** Show a time of the page, s, in all panels; the scene of the lead shows it already. */
  show(seconds) {
    const k = this.sampleAt(seconds);
    this.view.show(k);
    this.panels.forEach(show => show(k));
  }
}

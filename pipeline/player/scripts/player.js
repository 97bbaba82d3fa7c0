// One case and one time, which all panels of a page show; see pipeline/player/panel.py for what a page carries.

const FIRED = 0.05; // as in the review of rules
const AFTER_S = 1800; // how long free motion is plotted after the end

/** The cases of a page: their numbers, columns and whether they succeed. */
function readCases({ numbers, columns, isGood }) {
  const good = bytesOf(isGood);
  return {
    numbers: new Int32Array(bytesOf(numbers).buffer),
    columns: columns.map(column => ({ ...column, values: floatsOf(column.values) })),
    isGood: row => (good[row >> 3] >> (row & 7) & 1) > 0,
    get count() { return this.numbers.length; },
  };
}

/** The rule with the largest share in a push, in words. */
function namedRule(systems, quadrature) {
  return (flight, k, axis) => {
    const index = systems.findIndex(({ axis: driven }) => driven === axis);
    const reason = flight.reason(k, axis);
    if (index < 0 || (reason !== "fired" && reason !== "clipped")) return `${flight.words[reason][0].toUpperCase()}${flight.words[reason].slice(1)}.`;
    const system = systems[index], steps = infer(system, Array.from(flight.inputs(k, index, system.inputs.length)));
    const parts = shares(system, 0, steps, quadrature).values, sign = Math.sign(flight.force(k)[axis]);
    const best = parts.reduce((most, part, rule) => (part * sign > parts[most] * sign ? rule : most), 0);
    return `Rule ${best + 1} of ${system.name}: ${system.rules[best].words}.`;
  };
}

class Player {
  constructor(page) {
    this.page = page;
    this.part = name => document.querySelector(`#player .${name}`);
    this.quadrature = { chances: decodeDoubles(page.quadrature[0]), weights: decodeDoubles(page.quadrature[1]) };
    this.systems = page.systems.map(system => ({ ...decodeSystem(system), axis: system.axis }));
    this.marks = [];
    this.panels = [];
    this.row = null;
    this.opening = 0;
    const points = floatsOf(page.flight.points);
    this.shared = {
      ...page.flight, words: page.words, freeMotion: floatsOf(page.flight.freeMotion), numSystems: this.systems.length,
      points: Array.from({ length: page.flight.numPoints }, (_, j) => three(points, j)), pushed: namedRule(this.systems, this.quadrature),
    };
    this.showNow = this.systems.map((system, index) => {
      const box = make("section", { class: "card" });
      this.part("inference").append(box);
      return systemNow(box, system, index);
    });
  }

  /** Return a row's flight: recorded with the page, or flown now. */
  async flightOf(row) {
    const recorded = this.page.recorded[row];
    if (recorded) return recordedFlight({ ...recorded, ...this.page.flight, coast: this.page.flight.freeMotion, words: this.page.words });
    const width = this.starts.length / this.cases.count, log = await this.ask({ start: this.starts.slice(row * width, (row + 1) * width) });
    const flight = flownFlight(this.shared, log);
    if (this.page.flight.isPlain) flight.isLit = (k, j) => facesSun(flight.points[j], flight.sun(k));
    return flight;
  }

  async begin() {
    const { module, snapshot, starts, cases } = this.page;
    if (module) {
      this.ask = beginWorker(this.page.worker);
      await this.ask({ module, snapshot });
      this.starts = new Float64Array(await inflated(starts));
    }
    if (cases) this.showCases();
    const address = new URLSearchParams(location.hash.slice(1));
    const row = this.rowOf(address), k = Number(address.get("k"));
    await this.open(row ?? this.page.first, row !== null && Number.isFinite(k) ? k : null);
    addEventListener("hashchange", () => {
      const now = new URLSearchParams(location.hash.slice(1)), asked = this.rowOf(now);
      if (asked !== null) this.open(asked, Number(now.get("k")) || 0);
    });
    addEventListener("resize", onceIdle(() => this.showPanels()));
  }

  /** The row that an address asks for; null for none that can be opened. */
  rowOf(address) {
    const row = address.has("case") && this.cases ? this.cases.numbers.indexOf(Number(address.get("case"))) : -1;
    return row >= 0 && this.canOpen(row) ? row : null;
  }

  canOpen(row) {
    return Boolean(this.page.module) || row in this.page.recorded;
  }

  showCases() {
    this.cases = readCases(this.page.cases);
    const open = row => this.open(row), named = name => this.cases.columns.find(column => column.name === name);
    const name = words => () => `cases-${words}`;
    this.dots = [
      scatter(this.part("fuel-dots"), "Fuel and what was inspected", [named("delta_v_m_s"), named("inspection_rate_percent")], this.cases, open, name("fuel")),
      scatter(this.part("distance-dots"), "Nearest and farthest", [named("min_distance_m"), named("max_distance_m")], this.cases, open, name("distances")),
    ];
    this.marks = [...this.dots.map(({ mark }) => mark), histogram(this.part("bars"), "How the fuel spreads", named("delta_v_m_s"), this.cases, open, name("fuel-bars")), casesTable(this.part("table"), this.cases, open)];
  }

  /** Open a case, at a sample if one is given; of several that are asked for at once the last counts. */
  async open(row, sample = null) {
    const turn = ++this.opening, said = this.part("said");
    if (!this.canOpen(row)) {
      said.textContent = `Case ${this.cases.numbers[row]} was not recorded with this page: ${this.page.why}. This flies it: ${this.page.command.replace("CASE", this.cases.numbers[row])}`;
      return;
    }
    let flight = null;
    try {
      flight = await this.flightOf(row);
    } catch (error) {
      said.textContent = `This case could not be flown here: ${error.message}`;
      return;
    }
    if (turn !== this.opening) return;
    said.textContent = "";
    this.row = row;
    this.flight = flight;
    this.counts = Array.from({ length: flight.numSamples }, (_, k) => flight.numSeen(k));
    this.seenAt = flight.points.map((_, j) => { for (let k = 0; k < flight.numSamples; k++) if (flight.isSeen(k, j)) return k; return null; });
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches ? Math.round(flight.numSamples / 3) : 0;
    const k = Math.min(Math.max(0, Math.round(sample ?? this.view?.sample ?? still)), flight.numSamples - 1);
    if (this.view) this.view.replace(flight);
    else this.view = new FlightView(document.querySelector("#player .scene"), flight, { onSample: now => this.showSample(now) });
    this.showPanels();
    this.marks.forEach(mark => mark(row));
    this.view.show(k);
    this.showSample(this.view.sample);
    document.dispatchEvent(new CustomEvent("opened"));
  }

  /** Draw what belongs to the flight as a whole. */
  showPanels() {
    const { flight } = this, { numSamples, periodS } = flight, end = numSamples - 1;
    const go = k => { this.view.pause(); this.view.show(k); }, fileName = words => () => `${this.page.fileName}-${this.words("case")}-${words}`;
    const all = value => Array.from({ length: numSamples }, (_, k) => value(k)), far = at => Math.hypot(...at);
    const free = this.freeDistances(end), lines = [{ name: "distance_m", values: all(k => far(flight.position(k))) }];
    if (free.length) lines.push({ name: "free_motion_m", values: free, first: end, dash: "5 4" });
    this.part("which").textContent = this.words("title");
    this.part("outcome").textContent = `${flight.spent(end).toFixed(3)} m/s · ${this.counts[end]} of ${flight.points.length} points · ${Math.min(...lines[0].values).toFixed(1)} to ${Math.max(...lines[0].values).toFixed(1)} m${this.cases ? ` · ${this.cases.isGood(this.row) ? "succeeds" : "fails"}` : ""}`;
    this.panels = [
      timePlot(this.part("distance"), "Distance from the chief", { lines, limits: flight.limits, unit: "m", decimals: 1, flight, after: free.length ? AFTER_S / 60 : 0, fileName: fileName("distance") }, go),
      timePlot(this.part("fuel"), "Δv spent", { lines: [{ name: "delta_v_m_s", values: all(flight.spent) }], unit: "m/s", decimals: 3, flight, fileName: fileName("fuel") }, go),
      timePlot(this.part("progress"), "Points inspected", { lines: [{ name: "points", values: this.counts }], unit: "", decimals: 0, flight, fileName: fileName("points") }, go),
      pointsMap(this.part("map"), flight, this.seenAt, go, fileName("map")),
      boutsList(this.part("events"), flight, go),
      ...this.showNow.map(show => k => show(flight, k)),
    ];
    this.panels.forEach(show => show(this.view.sample));
  }

  /** Distances of free motion after the end, a value a sample, as it is drawn in the scene. */
  freeDistances(end) {
    const path = this.flight.coast(end);
    if (!path) return [];
    const step = 2 * Math.PI / this.page.flight.meanMotion / (path.length - 1);
    return Array.from({ length: Math.floor(AFTER_S / this.flight.periodS) + 1 }, (_, i) => {
      const at = i * this.flight.periodS / step, before = Math.floor(at), share = at - before, next = path[Math.min(before + 1, path.length - 1)];
      return Math.hypot(...path[before].map((value, axis) => value + share * (next[axis] - value)));
    });
  }

  words(what) {
    const number = this.cases?.numbers[this.row];
    if (what === "case") return number === undefined ? "flight" : `case-${number}`;
    return number === undefined ? this.page.title : `Case ${number}`;
  }

  /** Show a sample in all panels, and in the address. */
  showSample(k) {
    this.panels.forEach(show => show(k));
    this.remember ??= onceIdle(() => {
      if (this.cases) history.replaceState(null, "", `#run=${encodeURIComponent(this.page.fileName)}&case=${this.cases.numbers[this.row]}&k=${this.view.sample}`);
    });
    if (this.hasShown) this.remember();
    this.hasShown = true;
  }
}

const player = new Player(PLAYER);
player.beginWorker = beginWorker;
// for whoever looks from the console, and the tests
globalThis.player = player;
player.begin().catch(error => { player.part("said").textContent = error.message; });

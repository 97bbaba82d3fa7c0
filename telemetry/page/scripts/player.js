// Cases, and one time, which all panels of a page show; see pipeline/player/panel.py for what a page carries.

const LETTERS = "ABCDEFGH";

/** The letters of flights beside each other, fleet by fleet, from how many deputies each fleet has. */
function lettersOf(fleets) {
  if (fleets.length === 1) return [fleets[0] === 1 ? [""] : [...LETTERS].slice(0, fleets[0])];
  const numbered = (size, letter) => Array.from({ length: size }, (_, deputy) => `${letter}${deputy + 1}`);
  return fleets.map((size, index) => (size === 1 ? [LETTERS[index]] : numbered(size, LETTERS[index])));
}

/** The cases of a set of runs: their numbers, columns, words, and which run succeeds in them. */
async function readCases({ steps, columns, succeeds, words, outcome }) {
  const marks = succeeds.map(bytesOf), succeedsIn = marks.map(mark => row => (mark[row >> 3] >> (row & 7) & 1) > 0);
  return {
    numbers: new Int32Array(bytesOf(steps).buffer).map((sum => step => (sum += step))(0)),
    columns: await Promise.all(columns.map(async column => ({ ...column, values: Float64Array.from(new BigInt64Array((await planesOf(column.values, 8)).buffer), value => Number(value) / column.parts) }))),
    words, outcome, letters: [...LETTERS].slice(0, succeeds.length), succeeds: succeedsIn,
    isGood: row => succeedsIn.every(succeedsAt => succeedsAt(row)),
    get count() { return this.numbers.length; },
  };
}

class Player {
  constructor(page) {
    this.page = page;
    this.root = document.getElementById("player");
    this.part = name => this.root.querySelector(`.${name}`);
    Object.assign(this, { marks: [], dots: [], row: null, opening: 0, seconds: null, shownSides: [] });
  }

  async begin() {
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(PLAYER_STYLE);
    document.adoptedStyleSheets.push(sheet);
    this.root.classList.add("begun");
    const { page } = this, roots = this.root.querySelectorAll(".side");
    const fleets = lettersOf(page.fleets).flatMap((letters, index) => letters.map(letter => ({ letter, fleet: { index, letters } })));
    this.sides = page.runs.map((run, index) => new Side(run, page, roots[index], fleets[index]));
    this.lead = this.sides[0];
    await Promise.all(this.sides.map(side => side.begin()));
    if (this.page.cases) await this.showCases();
    this.chooseSides();
    // before the first flight, which may take a while
    // by its address, as what is remembered meanwhile may stand in the page's own by now
    addEventListener("hashchange", ({ newURL }) => {
      const now = new URLSearchParams(new URL(newURL).hash.slice(1)), asked = this.rowOf(now);
      if (asked !== null) this.open(asked, this.secondsAt(Number(now.get("k")) || 0));
    });
    const address = new URLSearchParams(location.hash.slice(1)), row = this.rowOf(address), k = Number(address.get("k"));
    await this.open(row ?? this.page.first, row !== null && Number.isFinite(k) ? this.secondsAt(k) : null);
    addEventListener("resize", onceIdle(() => this.draw()));
    document.addEventListener("sought", ({ detail }) => this.seek(detail));
  }

  secondsAt(k) {
    return k * this.lead.run.flight.periodS;
  }

  /** The row that an address asks for; null for none that can be opened. */
  rowOf(address) {
    const row = address.has("case") && this.cases ? this.cases.numbers.indexOf(Number(address.get("case"))) : -1;
    return row >= 0 && this.sides.some(side => side.canOpen(row)) ? row : null;
  }

  /** Draw the cases as the page describes their plots, and as a table. */
  async showCases() {
    this.cases = await readCases(this.page.cases);
    const open = row => this.open(row), columns = names => names.map(name => this.cases.columns.find(column => column.name === name));
    const card = (name, label) => { const box = make("section", { class: `card ${name}`, "aria-label": label }); this.part("cases").append(box); return box; };
    for (const plot of this.page.cases.plots) {
      const box = card(plot.name, plot.title), [drawn, fileName] = [columns(plot.columns), () => `cases-${plot.name}`];
      if (plot.columns.length === 1) this.marks.push(histogram(box, plot, drawn, this.cases, open, fileName));
      else this.dots.push(scatter(box, plot, drawn, this.cases, open, fileName));
    }
    this.marks.push(...this.dots.map(({ mark }) => mark), casesTable(card("table", "Table of the cases"), this.cases, open));
  }

  /** Let the sides beside each other be chosen, where there are more than two; of each fleet one begins. */
  chooseSides() {
    const isFirst = ({ letter, fleet }) => this.page.fleets.length === 1 || letter === fleet.letters[0];
    const begun = this.sides.filter(isFirst).slice(0, 2);
    this.sides.forEach(side => { side.root.hidden = !begun.includes(side); });
    if (this.sides.length < 3) return;
    const boxes = this.sides.map(side => {
      const box = make("input", { type: "checkbox", change: () => {
        side.root.hidden = !box.checked;
        if (this.sides.every(({ root }) => root.hidden)) { box.checked = true; side.root.hidden = false; }
        if (this.row !== null) this.open(this.row, this.seconds);
      } });
      box.checked = !side.root.hidden;
      return make("label", {}, box, ` ${side.letter}: ${side.run.name}`);
    });
    this.part("chosen").replaceChildren(make("span", { class: "small" }, "Beside each other:"), ...boxes);
  }

  /** Open a row, at a time if one is given; of several that are asked for at once the last counts. */
  async open(row, seconds = null) {
    const turn = ++this.opening, said = this.part("said"), number = this.cases?.numbers[row];
    const asked = this.sides.filter(({ root }) => !root.hidden), able = asked.filter(side => side.canOpen(row));
    const refused = asked.filter(side => !side.canOpen(row)).map(side => side.refusal(number));
    said.textContent = [...new Set(refused)].join("\n"); // deputies of a fleet for one reason
    if (!able.length) return;
    let flights, fellows;
    try {
      flights = await Promise.all(able.map(side => side.flightOf(row)));
      fellows = await Promise.all(able.map(side => this.fellowsOf(side, row)));
    } catch (error) {
      said.textContent = `This case could not be flown here: ${error.message}`;
      return;
    }
    if (turn !== this.opening) return;
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches ? 1 / 3 : 0;
    this.take(able, flights);
    able.forEach((side, index) => { side.view.fellows = fellows[index]; });
    const whole = (this.lead.flight.numSamples - 1) * this.lead.flight.periodS;
    this.row = row;
    this.seconds = Math.min(Math.max(0, seconds ?? this.seconds ?? still * whole), whole);
    asked.forEach(side => side.root.classList.toggle("unopened", !able.includes(side)));
    this.draw();
    this.marks.forEach(mark => mark(row));
    this.lead.view.show(this.lead.sampleAt(this.seconds));
    this.showTime(this.seconds);
    this.tell("played", { number, systems: this.lead.sensed(), time: this.seconds });
  }

  /** What the other deputies of a side's fleet fly, also those that no side shows. */
  fellowsOf(side, row) {
    const others = this.sides.filter(other => other !== side && other.fleet.index === side.fleet.index && other.canOpen(row));
    return Promise.all(others.map(async other => ({ letter: other.letter, flight: await other.flightOf(row) })));
  }

  /** Give flights to their sides; the longest has the time that counts. */
  take(sides, flights) {
    const duration = index => flights[index].numSamples * flights[index].periodS;
    const first = sides.reduce((best, _, index) => (duration(index) > duration(best) ? index : best), 0);
    if (this.lead !== sides[first]) { // views are bound to the one that they follow
      this.lead.view?.pause();
      this.lead = sides[first];
      this.sides.forEach(side => { side.view = null; side.root.querySelector(".frame").replaceWith(side.root.querySelector(".frame").cloneNode(true)); });
    }
    const follow = k => this.showTime(k * this.lead.flight.periodS);
    [first, ...sides.keys()].forEach(index => sides[index].take(flights[index], this.lead, follow));
    this.shownSides = sides;
  }

  /** Tell others of the page what is played. */
  tell(what, detail) {
    document.dispatchEvent(new CustomEvent(what, { detail }));
  }

  /** Show a time that others of the page ask for, of a case if they name one that opens. */
  seek({ number, time }) {
    const row = this.cases?.numbers.indexOf(number) ?? -1;
    if (row >= 0 && row !== this.row && this.sides.some(side => side.canOpen(row))) this.open(row, time);
    else this.go(time);
  }

  go(seconds) {
    this.lead.view.pause();
    this.lead.view.show(this.lead.sampleAt(seconds));
  }

  /** Draw what belongs to the flights as a whole, with plots to one scale. */
  draw() {
    const all = this.shownSides.map(side => side.extents());
    const extents = Object.fromEntries(Object.keys(all[0]).map(name => [name, Math.max(...all.map(each => each[name]))]));
    const go = seconds => this.go(seconds), number = this.cases?.numbers[this.row];
    for (const side of this.shownSides) {
      const which = this.cases?.words[this.row] ?? (number === undefined ? this.page.title : `Case ${number}`);
      const succeeds = this.cases?.succeeds[side.fleet.index];
      side.draw({
        title: side.letter ? `${side.letter}: ${side.run.name}` : which,
        outcome: [side.letter && this.cases ? which : "", succeeds ? this.cases.outcome[succeeds(this.row) ? 1 : 2] : ""].filter(Boolean).join(" · "),
        fileName: `${side.run.fileName}-${number === undefined ? "flight" : `case-${number}`}`, extents, go,
      });
    }
    if (this.seconds !== null) this.shownSides.forEach(side => side.show(this.seconds));
  }

  /** Show a time, s, in all panels of all sides, and in the address. */
  showTime(seconds) {
    this.seconds = seconds;
    this.shownSides.forEach(side => side.show(seconds));
    this.remember ??= onceIdle(() => {
      if (this.cases) history.replaceState(null, "", `#run=${encodeURIComponent(this.page.fileName)}&case=${this.cases.numbers[this.row]}&k=${this.lead.sampleAt(this.seconds)}`);
    });
    this.tell("moved", { time: seconds });
    if (this.hasShown) this.remember();
    this.hasShown = true;
  }
}

const player = new Player(PLAYER);
// for whoever looks from the console, and the tests
globalThis.player = player;
player.begin().catch(error => { player.part("said").textContent = error.message; });

// The first page: a flight of one's own, and the rules behind it.

const $ = id => document.getElementById(id);
const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
const radians = degrees => degrees * Math.PI / 180, degrees = angle => angle * 180 / Math.PI;
const PART = 33; // flights between two chances for the page to answer

const flights = await openFlights(await inflated(MODULE), TABLE);
const { log, outcomes, tracks, starts } = flights;
const others = starts.slice(), width = starts.length / TABLE.num_starts;
const systems = structuredClone(TABLE.systems);
const numSamples = TABLE.num_controls + 1, numOutcomes = outcomes.length / TABLE.num_starts;
const numTracked = tracks.length / TABLE.num_starts / numSamples;
const stride = Math.round(TABLE.attributes.decision_period_s / TABLE.control_period_s);
const padded = flights.points.length / 3;

// --- the visitor's flight ---

const SLIDERS = { azimuth: 45, elevation: 35.5, distance: 75, sun: 0 };
const chosen = { ...SLIDERS };

const flown = {
  numSamples, periodS: TABLE.control_period_s, radius: TABLE.radius_m, limits: [TABLE.min_distance_m, TABLE.max_distance_m],
  stride, maxForce: TABLE.max_force_n, coastsWhenComplete: TABLE.coasts_when_complete, numCounted: TABLE.num_points,
  points: Array.from({ length: TABLE.num_points }, (_, j) => [0, 1, 2].map(axis => flights.points[axis * padded + j])),
  position: k => three(log.position, k),
  force: k => k < numSamples - 1 ? three(log.force, k) : [0, 0, 0],
  asked: k => three(log.asked, k),
  change: k => three(log.change, k),
  isDecided: k => log.isDecided[k] > 0,
  isGiven: () => false,
  numSeen: k => flown.points.filter((_, j) => flown.isSeen(k, j)).length,
  sun: k => [Math.cos(log.sun[k]), Math.sin(log.sun[k]), 0],
  isSeen: (k, j) => log.isInspected[k * TABLE.num_points + j] > 0,
  spent: k => log.spent[k],
  coast(k) {
    const state = [...three(log.position, k), ...three(log.velocity, k)], rows = flights.freeMotion;
    return Array.from({ length: rows.length / 18 }, (_, at) => [0, 1, 2].map(axis =>
      state.reduce((sum, value, column) => sum + rows[18 * at + 6 * axis + column] * value, 0)));
  },
  reason: (k, axis) => reasonAt(flown, k, axis),
  reasons(k) {
    document.querySelectorAll(".fires").forEach(cell => cell.classList.remove("fires"));
    return told(flown, k, TABLE.reasons, (decided, axis) => {
      const rule = mostMoving(axis, decided, Math.sign(flown.force(decided)[axis]));
      if (decided === k) $(`cell-${axis}-${rule}`)?.classList.add("fires");
      return ruleText(axis, rule);
    });
  },
};

function mostMoving(axis, k, sign) {
  const first = (k * systems.length + axis) * (log.inputs.length / (TABLE.num_controls * systems.length));
  const moved = flights.shares(axis, systems[axis].inputs.map((_, column) => log.inputs[first + column]));
  return moved.reduce((best, share, rule) => share * sign > moved[best] * sign ? rule : best, 0);
}

const words = name => name.replace(/_/g, " ");
function ruleText(axis, rule) {
  const system = systems[axis];
  return `${system.sentences[rule]} then ${system.output.name} is ${system.output.terms[system.rules[rule].then].name}.`;
}

function flyOwn() {
  const e = radians(chosen.elevation), a = radians(chosen.azimuth), d = chosen.distance;
  starts.set([Math.sin(a) * Math.cos(e) * d, Math.cos(a) * Math.cos(e) * d, Math.sin(e) * d, 0, 0, 0, radians(chosen.sun), 0]);
  flights.fly(0, 1, { isLogged: true });
  view.renew();
  writeAddress();
}

function startFrom(kind, [x, y], { eye, right, up }) {
  if (kind === "start") {
    const d = chosen.distance, flat = Math.min(1, d / Math.hypot(x, y));
    const deep = Math.sqrt(Math.max(0, d * d - flat * flat * (x * x + y * y))) * (Math.sign(dot(flown.position(0), eye)) || 1);
    const p = [0, 1, 2].map(axis => flat * x * right[axis] + flat * y * up[axis] + deep * eye[axis]);
    chosen.elevation = degrees(Math.asin(Math.max(-1, Math.min(1, p[2] / d))));
    chosen.azimuth = degrees(Math.atan2(p[0], p[1]));
  } else { // where the Sun's direction in the orbit plane appears under the pointer
    const deep = Math.abs(eye[2]) > 0.05 ? -(x * right[2] + y * up[2]) / eye[2] : 0;
    const p = [0, 1].map(axis => x * right[axis] + y * up[axis] + deep * eye[axis]);
    const turned = log.sun[0] - log.sun[view.sample];
    chosen.sun = (degrees(Math.atan2(p[1], p[0]) + turned) + 720) % 360;
  }
  showSliders();
  flyOwn();
}

function showSliders() {
  const text = {
    azimuth: value => `${value.toFixed(0)}°`, elevation: value => `${value.toFixed(0)}°`,
    distance: value => `${value.toFixed(0)} m`, sun: value => `${value.toFixed(0)}°`,
  };
  for (const name of Object.keys(SLIDERS)) { $(name).value = chosen[name]; $(`${name}-text`).textContent = text[name](chosen[name]); }
}

// --- all flights, as the rules were and as they are ---

let job = 0, first = null, latest = null;

/** Fly all other starts; return what became of them and their outcomes, or null where another job began meanwhile. */
async function flyOthers(mine, isTracked) {
  for (let start = 1; start < TABLE.num_starts; start += PART) {
    await new Promise(resolve => setTimeout(resolve));
    if (mine !== job) return null;
    flights.fly(start, Math.min(TABLE.num_starts, start + PART), { isTracked });
  }
  const rows = Array.from({ length: TABLE.num_starts - 1 }, (_, i) => outcomes.slice((i + 1) * numOutcomes, (i + 2) * numOutcomes));
  const needed = Math.ceil(TABLE.num_points * TABLE.threshold_percent / 100 - 1e-9);
  const mean = values => values.reduce((sum, value) => sum + value, 0) / values.length;
  const isIn = row => row[TABLE.outcomes.outside] === 0;
  return {
    success: 100 * mean(rows.map(row => +(isIn(row) && row[TABLE.outcomes.inspected] >= needed))),
    fuel: mean(rows.map(row => row[TABLE.outcomes.delta_v])), outside: rows.filter(row => !isIn(row)).length,
    areOutside: rows.map(row => !isIn(row)),
  };
}

async function flyAll() {
  const mine = ++job, began = performance.now();
  if (isEdited() && !first) { // what others are compared with is the controller as it is
    pack(flights, TABLE.systems);
    const unchanged = await flyOthers(mine, false);
    if (!unchanged) return null;
    first = unchanged;
  }
  pack(flights, systems);
  flyOwn();
  const isTracked = $("cloud").checked, packed = JSON.stringify(systems), found = await flyOthers(mine, isTracked);
  if (!found) return null;
  latest = { ...found, systems: packed };
  if (!isEdited()) first = latest;
  showMany(performance.now() - began);
  view.others = isTracked ? found.areOutside.map((isOutside, i) => ({ isOutside, path: track(i + 1) })) : [];
  view.draw();
  return latest;
}

function track(flight) {
  return Array.from({ length: Math.ceil(numSamples / 6) }, (_, i) => {
    const at = (flight * numSamples + Math.min(6 * i, numSamples - 1)) * numTracked;
    return [tracks[at], tracks[at + 1], tracks[at + 2]];
  });
}

function showMany(milliseconds) {
  const was = isEdited() ? { success: ` (was ${first.success.toFixed(1)})`, fuel: ` (was ${first.fuel.toFixed(3)})`, outside: ` (was ${first.outside})` }
    : { success: "", fuel: "", outside: "" };
  $("many").textContent = `${TABLE.num_starts - 1} other starts, any Sun: ${latest.success.toFixed(1)} % succeed${was.success}, `
    + `${latest.fuel.toFixed(3)} m/s on average${was.fuel}, ${latest.outside} leave the limits${was.outside}. `
    + `Flown in ${milliseconds.toFixed(0)} ms.`;
}

const isEdited = () => JSON.stringify(systems) !== JSON.stringify(TABLE.systems);

// --- the rules ---

const TITLES = ["Up and down: ", "Ahead and back: ", "Across the orbit: "];

function number(value) { return String(+value.toPrecision(3)); }

function element(name, attributes = {}, ...children) {
  const made = name === "svg" || SHAPES.has(name) ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}
const SHAPES = new Set(["polyline", "circle", "text", "line", "g"]);

function showRules() {
  const isOpen = [...document.querySelectorAll("#rules details")].map(details => details.open);
  $("rules").replaceChildren(...systems.map((system, index) => {
    const [rows, columns] = system.inputs, output = system.output;
    const head = [element("tr", {}, element("td", { class: "corner" }), element("th", { colspan: columns.terms.length, scope: "colgroup" }, `${words(columns.name)} is`)),
      element("tr", {}, element("th", { scope: "col" }, `${words(rows.name)} is`),
        ...columns.terms.map(term => element("th", { scope: "col" }, termText(term, columns))))];
    const body = rows.terms.map((term, i) => element("tr", {}, element("th", { scope: "row" }, termText(term, rows)),
      ...columns.terms.map((_, j) => cell(system, index, i, j))));
    const details = element("details", {}, element("summary", {}, "What the words mean: drag the peaks"),
      ...[...system.inputs, output].map((variable, at) => termsOf(index, variable, at)));
    details.open = isOpen[index] ?? false;
    return element("section", {}, element("h3", {}, `${TITLES[index]}${output.name}, ${output.unit}`),
      element("p", { class: "small" }, `Then ${output.name} is`), element("table", {}, ...head, ...body), details);
  }));
}

const termText = (term, variable) => `${words(term.name)}, ${number(term.peak)} ${variable.unit}`;

function cell(system, index, i, j) {
  const at = system.rules.findIndex(rule => rule.if[0] === i && rule.if[1] === j), rule = system.rules[at];
  const term = system.output.terms[rule.then], isChanged = rule.then !== TABLE.systems[index].rules[at].then;
  const button = element("button", { type: "button", title: `${system.sentences[at]} then ${system.output.name} is ${words(term.name)}; click for the next term, with Shift for the one before` },
    `${words(term.name)} ${number(term.peak)}`);
  button.addEventListener("click", event => {
    rule.then = (rule.then + (event.shiftKey ? system.output.terms.length - 1 : 1)) % system.output.terms.length;
    changed(`cell-${index}-${at}`);
  });
  return element("td", { id: `cell-${index}-${at}`, ...(isChanged && { class: "changed" }) }, button);
}

function changed(focused) {
  showRules();
  document.querySelector(`#${focused} button, circle#${focused}`)?.focus();
  return flyAll();
}

/** Draw a variable's terms; a peak that moves takes the feet of its neighbours along. */
function termsOf(index, variable, at) {
  const [low, high] = variable.range, x = value => 6 + 288 * (value - low) / (high - low), y = degree => 56 - 44 * degree;
  const picture = element("svg", { viewBox: "0 0 300 74", class: "terms" });
  variable.terms.forEach((term, order) => {
    const name = `peak-${index}-${at}-${order}`, peak = x(term.peak);
    picture.append(element("polyline", { points: [[term.left, 0], [term.peak, 1], [term.right, 0]].map(([v, d]) => `${x(v)},${y(d)}`).join(" ") }));
    picture.append(element("text", { x: Math.min(Math.max(peak, 22), 278), y: 70, "text-anchor": "middle" }, number(term.peak)));
    const handle = element("circle", { id: name, class: "handle", cx: peak, cy: y(1), r: 6, tabindex: 0, role: "slider", "aria-label": `${words(variable.name)} ${words(term.name)}`,
      "aria-valuemin": low, "aria-valuemax": high, "aria-valuenow": number(term.peak), "aria-valuetext": `${number(term.peak)} ${variable.unit}` });
    const move = value => { movePeak(variable, order, value); changed(name); };
    handle.addEventListener("keydown", event => {
      const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (step && !event.ctrlKey && !event.altKey && !event.metaKey) { event.preventDefault(); move(term.peak + step * (high - low) / 50); }
    });
    handle.addEventListener("pointerdown", event => {
      event.preventDefault();
      const box = picture.getBoundingClientRect();
      const follow = moved => move(low + (high - low) * ((moved.clientX - box.left) / box.width * 300 - 6) / 288);
      const end = () => { removeEventListener("pointermove", follow); removeEventListener("pointerup", end); };
      addEventListener("pointermove", follow); addEventListener("pointerup", end);
    });
    picture.append(handle);
  });
  return element("div", {}, element("p", { class: "small" }, `${words(variable.name)}${variable.unit ? `, ${variable.unit}` : ""}: ${variable.description}`), picture);
}

function movePeak(variable, order, value) {
  const { terms, range: [low, high] } = variable, gap = (high - low) / 100, was = terms[order].peak;
  const least = order ? terms[order - 1].peak + gap : low, most = order < terms.length - 1 ? terms[order + 1].peak - gap : high;
  const peak = +Math.min(Math.max(value, least), most).toPrecision(6);
  for (const side of ["left", "right"]) {
    terms.forEach(term => { if (term !== terms[order] && term[side] === was) term[side] = peak; });
  }
  terms[order].peak = peak;
  terms[order].left = Math.min(terms[order].left, peak);
  terms[order].right = Math.max(terms[order].right, peak);
}

// --- guess first ---

function askGuess() {
  const [index, at] = [0, systems[0].rules.findIndex(rule => rule.if[0] === 2 && rule.if[1] === 1)];
  const system = systems[index], wanted = system.output.terms.findIndex(term => term.name === "negative_small");
  const question = element("p", {}, element("b", {}, "Guess first. "), `${system.sentences[at]} then push up gently: what if it pushed down gently instead?`);
  const answers = ["About as good", "A few more fail", "Most fail"].map((text, guess) => {
    const button = element("button", { class: "plain", type: "button" }, text);
    button.addEventListener("click", async () => {
      const before = latest?.systems === JSON.stringify(systems) ? latest : await flyAll();
      if (!before) return;
      const was = system.rules[at].then, numRules = systems.reduce((sum, each) => sum + each.rules.length, 0);
      system.rules[at].then = wanted;
      const after = await changed(`cell-${index}-${at}`);
      if (!after) return;
      const lost = before.success - after.success, truth = lost < 2 ? 0 : after.success >= 50 ? 1 : 2;
      const why = was === wanted ? "It pushed down already: nothing was changed." : `One rule of ${numRules} did that; a network would not have told which.`;
      $("guess").replaceChildren(element("p", {}, element("b", {}, guess === truth ? "You guessed it. " : "Not quite. "),
        `${before.success.toFixed(1)} % succeeded, now ${after.success.toFixed(1)} %; ${after.outside} of ${TABLE.num_starts - 1} leave the limits. ${why} Put it back below, or change another.`));
    });
    return button;
  });
  // the question tells what the champion's own rule says
  const isOwn = system.rules[at].then === TABLE.systems[index].rules[at].then;
  $("guess").replaceChildren(...(isOwn ? [question, ...answers] : [element("p", { class: "small" }, "Put the champion's own rules back to be asked a question.")]));
}

// --- the address, and a file ---

let writing;
function writeAddress() {
  clearTimeout(writing);
  writing = setTimeout(() => {
    const query = new URLSearchParams(Object.entries(chosen).map(([name, value]) => [name, value.toFixed(1)]));
    query.set("k", view.sample);
    const rules = systems.flatMap((system, a) => system.rules.flatMap((rule, b) => rule.then === TABLE.systems[a].rules[b].then ? [] : [`${a}-${b}-${rule.then}`]));
    const peaks = systems.flatMap((system, a) => [...system.inputs, system.output].flatMap((variable, b) => variable.terms.flatMap((term, c) =>
      term.peak === variableOf(TABLE.systems[a], b).terms[c].peak ? [] : [`${a}_${b}_${c}_${term.peak}`])));
    if (rules.length) query.set("rules", rules.join("."));
    if (peaks.length) query.set("peaks", peaks.join("~"));
    history.replaceState(null, "", `#${query}`);
  }, 200);
}

const variableOf = (system, at) => at < system.inputs.length ? system.inputs[at] : system.output;

function readAddress() {
  const query = new URLSearchParams(location.hash.slice(1));
  for (const [name, value] of Object.entries(SLIDERS)) {
    const given = query.has(name) ? +query.get(name) : NaN, slider = $(name);
    chosen[name] = Number.isFinite(given) ? Math.min(Math.max(given, +slider.min), +slider.max) : value;
  }
  systems.splice(0, systems.length, ...structuredClone(TABLE.systems));
  for (const edit of (query.get("rules") ?? "").split(".")) {
    const [a, b, term] = edit.split("-").map(Number), rule = systems[a]?.rules[b];
    if (rule && systems[a].output.terms[term]) rule.then = term;
  }
  for (const edit of (query.get("peaks") ?? "").split("~")) {
    const [a, b, c, peak] = edit.split("_").map(Number), variable = systems[a] && variableOf(systems[a], b);
    if (variable?.terms[c] && Number.isFinite(peak)) movePeak(variable, c, peak);
  }
  return query.has("k") && Number.isFinite(+query.get("k")) ? Math.round(+query.get("k")) : null;
}

/** Return the controller's file with what was changed, under a name of its own. */
function asYaml() {
  const terms = systems.flatMap(system => [...system.inputs, system.output].flatMap(variable => variable.terms));
  const consequents = systems.flatMap(system => system.rules.map(rule => system.output.terms[rule.then].name));
  const real = value => Number.isInteger(value) ? value.toFixed(1) : String(value).includes("e") ? value.toFixed(12) : String(value);
  const file = isEdited() ? TABLE.file : TABLE.file
    .replace(/^name: .*$/m, () => `name: ${TABLE.controller}`)
    .replace(/^purpose: .*$/m, () => `purpose: ${JSON.stringify(TABLE.purpose)}`);
  return file
    .replace(/\{name: (\w+), left: [^,]+, peak: [^,]+, right: [^}]+\}/g, (_, name) => {
      const { left, peak, right } = terms.shift();
      return `{name: ${name}, left: ${real(left)}, peak: ${real(peak)}, right: ${real(right)}}`;
    })
    .replace(/rules: \[[^\]]*\]/g, block => block.replace(/^ +(?:\w+, *)+/gm, row => row.replace(/\w+(?=,)/g, () => consequents.shift())));
}

// --- begin ---

// for whoever looks from the console, and the tests
globalThis.flightPage = { flights, systems, flown, flyAll, asYaml, mostMoving, isLit: facesSun };

const view = new FlightView($("scene"), flown, { touch: startFrom, onTime: writeAddress });
globalThis.flightPage.view = view;
for (const name of Object.keys(SLIDERS)) {
  $(name).addEventListener("input", event => { chosen[name] = +event.target.value; showSliders(); flyOwn(); });
}
$("cloud").addEventListener("change", flyAll);
$("share").addEventListener("click", async () => {
  const isCopied = await navigator.clipboard?.writeText(location.href).then(() => true, () => false);
  $("share").textContent = isCopied ? "Copied" : "It is in the address bar";
});
$("reset").addEventListener("click", () => {
  systems.splice(0, systems.length, ...structuredClone(TABLE.systems));
  showRules(); askGuess(); flyAll();
});
$("save").addEventListener("click", () => {
  const link = element("a", { href: URL.createObjectURL(new Blob([asYaml()], { type: "application/yaml" })), download: `${TABLE.controller}${isEdited() ? "-edited" : ""}.yaml` });
  link.click();
  URL.revokeObjectURL(link.href);
});
addEventListener("hashchange", () => { const k = readAddress(); showSliders(); showRules(); askGuess(); if (k !== null) view.show(k); flyAll(); });

const requested = readAddress();
showSliders();
showRules();
askGuess();
pack(flights, systems);
flyOwn();
if (requested !== null) view.show(requested);
else if (isStill) view.show(130);
else view.play();
requestAnimationFrame(() => {
  performance.mark("first flight");
  $("took").textContent = `First picture ${Math.round(performance.now())} ms after the page was opened.`;
  setTimeout(flyAll, 200);
});

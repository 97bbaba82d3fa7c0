// One inference step by step: sliders, fuzzified inputs, fired rules, the aggregated output and its number.

const MOST_RULES = 8;
const LOW_PLOT = 60;
const SHOWN_FROM = 0.005;
// what rounding may add to a part of a whole
const SURPLUS = 1e-9;

/** The number that a text says, or null: a point before the decimals, no other mark, so that 12,5 is not 125. */
function numberSaid(text) {
  const words = text.trim().replace("−", "-");
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(words)) return null;
  return Number.isFinite(Number(words)) ? Number(words) : null;
}

/** A slider and a number field for one input, which follow the state and set it. */
function inputControl(state, place, id) {
  const variable = state.system.inputs[place];
  const limits = { min: variable.minimum, max: variable.maximum, step: "any" };
  const about = `${withUnit(variable)}, slider`;
  const slider = make("input", { type: "range", id: `${id}-slider`, ...limits, "aria-label": about });
  const field = make("input", { class: "amount", id, inputmode: "decimal", autocomplete: "off", spellcheck: "false" });
  const wrong = make("p", { class: "wrong", role: "alert" });
  const tell = (words) => {
    wrong.textContent = words;
    field.setAttribute("aria-invalid", String(words !== ""));
  };
  const follow = () => {
    field.value = String(Number(state.inputs[place].toPrecision(6)));
    tell("");
  };
  slider.addEventListener("input", () => state.setInput(place, Number(slider.value)));
  field.addEventListener("input", () => {
    const value = numberSaid(field.value);
    tell(value === null ? "This is no number; write one such as 12.5 or 1e-3." : "");
    if (value !== null) state.setInput(place, value);
  });
  field.addEventListener("blur", follow);
  slider.addEventListener("keydown", (event) => {
    const direction = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
    if (!direction || event.ctrlKey || event.altKey || event.metaKey) return; // the browser's own
    event.preventDefault();
    const moved = Number(slider.value) + (direction * (variable.maximum - variable.minimum)) / 100;
    state.setInput(place, Math.min(Math.max(moved, variable.minimum), variable.maximum));
  });
  state.follow(() => {
    const value = state.inputs[place];
    slider.value = String(value);
    slider.setAttribute("aria-valuetext", quantity(value, variable));
    // what is being typed is left alone
    if (document.activeElement !== field) follow();
  });
  const label = make("label", { for: id }, withUnit(variable));
  return make("div", { class: "control" }, label, field, slider, wrong);
}

/** Say to which terms a value belongs, the best first. */
function membershipWords(variable, memberships) {
  const belonging = Array.from(memberships, (value, term) => ({ value, name: variable.terms[term].name }))
    .filter(({ value }) => value >= SHOWN_FROM)
    .sort((a, b) => b.value - a.value);
  return belonging.map(({ value, name }) => `${name} ${value.toFixed(2)}`).join(" · ") || "belongs to no term";
}

function inputStep(state, place, id) {
  const variable = state.system.inputs[place];
  const chart = membershipChart(variable, `Membership functions of ${variable.name}, with its present value`, LOW_PLOT, () => show());
  const follow = (event) => {
    if (event.type === "pointerdown" || event.buttons === 1) state.setInput(place, chart.valueAt(event));
  };
  chart.svg.classList.add("settable");
  for (const kind of ["pointerdown", "pointermove"]) chart.svg.addEventListener(kind, follow);
  const words = make("p", { class: "belongs" });
  const show = () => {
    const { clipped, memberships } = state.inference;
    const x = chart.x(clipped[place]);
    const cursor = draw("line", { class: "cursor", x1: x, x2: x, y1: chart.y(0), y2: chart.y(1) });
    const dots = memberships[place].flatMap((value, term) => {
      if (value < SHOWN_FROM) return [];
      return [draw("circle", { class: `dot term-${term % 7}`, cx: x, cy: chart.y(value), r: 3.6 })];
    });
    chart.over.replaceChildren(cursor, ...dots);
    const isOutside = clipped[place] !== state.inputs[place];
    const given = `${variable.name} = ${quantity(state.inputs[place], variable, 5)}`;
    const taken = isOutside ? `, taken as ${quantity(clipped[place], variable, 5)}, the end of its range` : "";
    words.textContent = `${given}${taken}: ${membershipWords(variable, memberships[place])}`;
  };
  state.follow(show);
  return make("div", { class: "input" }, inputControl(state, place, id), chart.svg, words);
}

/** A bar from nothing to a strength in [0, 1]. */
function strengthBar(strength) {
  const bar = make("span", { class: "bar", "aria-hidden": "true" }, make("span"));
  bar.firstChild.style.width = `${(100 * Math.min(strength, 1)).toFixed(1)}%`;
  return bar;
}

/** Name some rules: the first of them with links, how many more. */
function ruleLinks(rules, id) {
  const links = rules.slice(0, MOST_RULES).map((rule) => make("a", { href: `#${id}-r${rule + 1}` }, String(rule + 1)));
  const parts = links.flatMap((link, i) => (i === 0 ? [link] : [i + 1 === rules.length ? " and " : ", ", link]));
  return rules.length > MOST_RULES ? [...parts, ` and ${rules.length - MOST_RULES} more`] : parts;
}

/** What each conclusion adds, its part of the whole if it is one, and which rules come to it, as items of a list. */
function conclusionItems({ system, inference }, output, share, nothing, id) {
  const variable = system.outputs[output];
  const whole = inference.outputs[output].value - (variable.default ?? 0);
  const groups = new Map();
  share.forEach((value, rule) => {
    if (Math.abs(value) < nothing) return;
    const concluded = system.rules[rule].consequents.filter(([place, , weight]) => place === output && weight > 0);
    const terms = [...new Set(concluded.map(([, term]) => variable.terms[term].name))].join(" and ");
    const group = groups.get(terms) ?? { terms, rules: [], value: 0 };
    group.rules.push(rule);
    group.value += value;
    groups.set(terms, group);
  });
  // where conclusions pull apart, a part of the whole can be negative or more than all of it
  const parts = [...groups.values()].map(({ value }) => value / whole);
  const areParts = whole !== 0 && parts.every((part) => part >= 0 && part <= 1 + SURPLUS);
  return [...groups.values()]
    .sort((a, b) => Math.abs(b.value) - Math.abs(a.value))
    .map(({ terms, rules, value }) => {
      rules.sort((a, b) => Math.abs(share[b]) - Math.abs(share[a]) || a - b);
      const ofAll = areParts ? ` (${shown(100 * Math.min(1, value / whole), 2)} %)` : "";
      const [noun, verb] = rules.length > 1 ? ["rules", "say so together"] : ["rule", "says so"];
      const words = `, ${signed(value, variable, 3)}${ofAll}: ${noun} `;
      return make("li", {}, make("strong", {}, terms), words, ...ruleLinks(rules, id), ` ${verb}`);
    });
}

function firedRules(state, output, id, quadrature) {
  const { system, inference } = state;
  const variable = system.outputs[output];
  const nothing = 1e-9 * (variable.maximum - variable.minimum);
  const shown0 = (by) => (Math.abs(by) < nothing ? 0 : by);
  const needed = contributions(system, output, inference);
  const { values: share, error } = shares(system, output, inference, quadrature);
  const firing = Array.from(inference.firing.keys()).filter((rule) => inference.firing[rule] > 0);
  const size = (rule) => Math.abs(shown0(share[rule]));
  firing.sort((a, b) => size(b) - size(a) || inference.firing[b] - inference.firing[a] || a - b);
  const isShown = (rule, place) => place === 0 || inference.firing[rule] >= SHOWN_FROM;
  const rows = firing.slice(0, MOST_RULES).filter(isShown);
  const items = rows.map((rule) => {
    const without = Number.isNaN(needed[rule]) ? "without it there is no output" : `needed ${signed(shown0(needed[rule]), variable, 3)}`;
    const words = `${without}. ${system.rules[rule].words}`;
    return make(
      "li",
      {},
      make("a", { href: `#${id}-r${rule + 1}` }, `Rule ${rule + 1}`),
      strengthBar(inference.firing[rule]),
      make("span", { class: "number" }, inference.firing[rule].toFixed(2)),
      make("span", { class: "number" }, signed(shown0(share[rule]), variable, 3)),
      make("span", { class: "words" }, words),
    );
  });
  const left = firing.length - rows.length;
  const from = quantity(variable.default ?? 0, variable, 4);
  const words = [
    left ? `${left} more fire${left === 1 ? "s" : ""} with less of a share.` : "",
    `Shares (Shapley values) add up to the way from ${from}, where no rule fires`,
    error ? `; they are sampled, with a standard error of ${quantity(error, variable, 2)} at most.` : ".",
    "Needed is what would be missing without the rule: nothing where others say the same.",
  ];
  return {
    conclusions: conclusionItems(state, output, share, nothing, id),
    items,
    note: firing.length ? words.filter(Boolean).join(" ").replace(" ;", ";").replace(" .", ".") : "No rule fires.",
  };
}

const METHODS = {
  centroid: "the centre of this area",
  bisector: "what halves this area",
  mom: "the mean of the highest points",
  som: "the lowest of the highest points",
  lom: "the greatest of the highest points",
};

function outputStep(state, output, chart) {
  const { system, inference } = state;
  const variable = system.outputs[output];
  const { points, heights, value, isDefault, cuts } = inference.outputs[output];
  const area = (xs, ys) => areaUnder(xs, ys, chart.x, chart.y);
  const clipped = variable.terms.map((term, i) => {
    const cut = Number.isNaN(cuts[i]) ? 0 : cuts[i];
    const lowered = term.values.map((membership) => Math.min(membership, cut));
    return draw("path", { class: `clipped term-${i % 7}`, d: area(variable.universe, lowered) });
  });
  chart.under.replaceChildren(...clipped, draw("path", { class: "aggregated", d: area(points, heights) }));
  chart.over.replaceChildren(...resultMarks(variable, value, chart));
  if (isDefault) return "No rule that concludes on it fires: this is its default.";
  return `This is ${METHODS[variable.defuzzifier]}.`;
}

/** A line and an arrow at an output's value. */
function resultMarks(variable, value, chart) {
  if (!Number.isFinite(value)) return [];
  const x = chart.x(Math.min(Math.max(value, variable.minimum), variable.maximum));
  return [
    draw("line", { class: "result", x1: x, x2: x, y1: chart.y(0) + 4, y2: chart.y(1) }),
    draw("path", { class: "result-mark", d: `M${x - 5} ${chart.y(0) + 10}h10l-5 -9z` }),
  ];
}

/** Say what the smallest change of one input is that turns the sign of an output. */
function signWords(state, output) {
  const { system, inputs, inference } = state;
  const { name, minimum, maximum } = system.outputs[output];
  if (minimum >= 0 || maximum <= 0) return "";
  if (signOf(system.outputs[output], inference.outputs[output].value) === 0) return `${name} is zero here.`;
  const found = signChange(system, inputs, output);
  if (!found) return `No change of one input alone turns the sign of ${name} from here.`;
  const variable = system.inputs[found.input];
  const change = `${variable.name} changes by ${signed(found.by, variable, 3)}, to ${quantity(found.at, variable, 4)}`;
  return `The sign of ${name} turns soonest where ${change} (${shown(100 * found.share, 2)} % of its range).`;
}

/** Fill an element with the inference view of a system. */
function inferenceView(element, state, id, quadrature) {
  const { system } = state;
  let output = 0;
  let chart = null;
  const conclusions = make("ul", { class: "conclusions" });
  const rules = make("ol", { class: "fired" });
  const note = make("p", { class: "note" });
  const picture = make("div");
  const result = make("output", { class: "value", for: system.inputs.map((_, i) => `${id}-x${i + 1}`).join(" ") });
  const how = make("p", { class: "note" });
  const sign = make("p", { class: "note sign" });
  const tellSign = onceIdle(() => {
    sign.textContent = signWords(state, output);
    sign.classList.remove("stale");
  });
  const show = () => {
    const variable = system.outputs[output];
    const fired = firedRules(state, output, id, quadrature);
    conclusions.replaceChildren(...fired.conclusions);
    rules.replaceChildren(...fired.items);
    note.textContent = fired.note;
    how.textContent = outputStep(state, output, chart);
    result.value = `${variable.name} = ${quantity(state.inference.outputs[output].value, variable, 5)}`;
    sign.classList.add("stale");
    tellSign();
  };
  const choose = (chosen) => {
    output = chosen;
    const about = `Terms of ${system.outputs[output].name}, cut and put together`;
    chart = membershipChart(system.outputs[output], about, LOW_PLOT, () => outputStep(state, output, chart));
    picture.replaceChildren(chart.svg);
    show();
  };
  const names = system.outputs.map(withUnit);
  const chooser = names.length > 1 ? [choice("Output", names, 0, choose).element] : [];
  const about = `Rules of ${system.name} that fire`;
  const scrolled = make("div", { class: "firing", role: "region", tabindex: "0", "aria-label": about }, conclusions, rules, note);
  const steps = [
    ["1. Inputs and their terms", ...system.inputs.map((_, place) => inputStep(state, place, `${id}-x${place + 1}`))],
    ["2. Rules that fire, and their shares", scrolled],
    ["3. Output", ...chooser, result, picture, how, sign],
  ];
  element.append(...steps.map(([title, ...parts]) => make("div", { class: "step" }, make("h4", {}, title), ...parts)));
  choose(0);
  state.follow(show);
}

// What each system senses and concludes at the moment: its terms, filled as far as they hold, and its rules.

const FIRED = 0.05; // as in the review of rules
const TERMS = { width: 300, height: 66, left: 8, right: 292, top: 8, floor: 46 };

/** A variable's terms; returned is {element, show(value, degrees, colour)}. */
function termsPicture(variable) {
  const x = linear(variable.minimum, variable.maximum, TERMS.left, TERMS.right), y = linear(0, 1, TERMS.floor, TERMS.top);
  const fills = variable.terms.map(() => draw("path", { class: "fill" }));
  const mark = draw("line", { y1: TERMS.top - 2, y2: TERMS.floor + 2, stroke: "var(--ink)", "stroke-width": 2 }), word = draw("text", { y: 62, "text-anchor": "middle", style: "fill:var(--ink)" });
  const curves = variable.terms.map(({ values }) => draw("path", { fill: "none", stroke: "var(--muted)", d: pathThrough(variable.universe, values, x, y) }));
  const element = draw("svg", { viewBox: `0 0 ${TERMS.width} ${TERMS.height}`, role: "img", "aria-label": `Terms of ${variable.name.replaceAll("_", " ")}` }, ...fills, ...curves, mark, word);
  return {
    element,
    show(value, degrees) {
      const inside = Math.min(Math.max(value, variable.minimum), variable.maximum);
      mark.setAttribute("x1", x(inside));
      mark.setAttribute("x2", x(inside));
      word.setAttribute("x", Math.min(Math.max(x(inside), 40), TERMS.width - 40));
      word.textContent = quantity(value, variable, 3);
      fills.forEach((fill, term) => {
        const { values } = variable.terms[term], height = degrees[term];
        fill.setAttribute("d", height > 0 ? areaUnder(variable.universe, Array.from(values, degree => Math.min(degree, height)), x, y) : "");
      });
    },
  };
}

/** The rules of a system of two inputs as a grid of cells by rule; null for other systems. */
function ruleGrid({ inputs, outputs: [output], rules }) {
  if (inputs.length !== 2) return null;
  const cells = new Map(), name = text => text.replaceAll("_", " ");
  rules.forEach(({ antecedent: [kind, operands], consequents: [[, term]] }, rule) => {
    if (kind === "and" && operands.length === 2 && operands.every(([each]) => each === "is")) {
      const terms = Object.fromEntries(operands.map(([, input, at]) => [input, at]));
      cells.set(`${terms[0]}-${terms[1]}`, [rule, make("td", {}, make("span", {}, String(rule + 1)), ` ${name(output.terms[term].name)}`)]);
    }
  });
  const [down, across] = inputs;
  if (cells.size !== rules.length || cells.size !== down.terms.length * across.terms.length) return null;
  const head = make("tr", {}, make("td", {}), ...across.terms.map(term => make("th", { scope: "col" }, name(term.name))));
  const rows = down.terms.map((term, i) => make("tr", {}, make("th", { scope: "row" }, name(term.name)), ...across.terms.map((_, j) => cells.get(`${i}-${j}`)[1])));
  return { element: make("table", { class: "grid" }, make("thead", {}, head), make("tbody", {}, ...rows)), cells: new Map(cells.values()) };
}

/** Show a system; returned is what shows a sample of a flight. */
function systemNow(box, system, index) {
  const name = text => text.replaceAll("_", " "), [output] = system.outputs;
  const inputs = system.inputs.map(termsPicture), conclusion = termsPicture(output), grid = ruleGrid(system);
  box.replaceChildren(make("h4", {}, system.name === output.name ? name(system.name) : `${name(system.name)} → ${name(output.name)}`),
    ...system.inputs.flatMap((variable, at) => [make("p", { class: "small" }, name(withUnit(variable))), inputs[at].element]),
    make("p", { class: "small" }, name(withUnit(output))), conclusion.element,
    ...(grid ? [make("p", { class: "small" }, `Rules by number; rows: ${name(system.inputs[0].name)}, columns: ${name(system.inputs[1].name)}.`), grid.element] : []));
  conclusion.element.classList.add("conclusion");
  const when = make("p", { class: "small" });
  box.append(when);
  return (flight, k) => {
    // between two decisions the last one stands, and is told with its time
    const decided = k - k % flight.stride, isOn = k < flight.numSamples - 1 && flight.isDecided(decided);
    box.classList.toggle("idle", !isOn);
    when.textContent = isOn ? `As decided at ${clockWords(decided * flight.periodS)}.` : "Nothing is inferred here.";
    if (!isOn) return;
    const sensed = Array.from(flight.inputs(decided, index, system.inputs.length)), steps = infer(system, sensed);
    inputs.forEach((picture, at) => picture.show(sensed[at], steps.memberships[at]));
    conclusion.show(steps.outputs[0].value, Array.from(steps.outputs[0].cuts, cut => (Number.isNaN(cut) ? 0 : cut)));
    const strongest = steps.firing.reduce((best, strength, rule) => (strength > steps.firing[best] ? rule : best), 0);
    grid?.cells.forEach((cell, rule) => {
      cell.style.setProperty("--strength", `${Math.round(35 * steps.firing[rule])}%`);
      cell.classList.toggle("most", rule === strongest && steps.firing[rule] > 0);
    });
  };
}

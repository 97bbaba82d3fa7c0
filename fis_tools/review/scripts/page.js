// The whole page: theme, tables, and the views of each system.

function followTheme() {
  const chooser = document.getElementById("theme");
  chooser.addEventListener("change", () => {
    document.documentElement.dataset.theme = chooser.value;
    redrawAll();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
}

/** Before printing: light colours, and what is folded is opened; afterwards all is as it was. */
function followPrinting() {
  const opened = [];
  addEventListener("beforeprint", () => {
    document.documentElement.dataset.printing = "";
    for (const folded of document.querySelectorAll("details:not([open])")) {
      folded.open = true;
      opened.push(folded);
    }
    redrawNow();
  });
  addEventListener("afterprint", () => {
    delete document.documentElement.dataset.printing;
    for (const folded of opened.splice(0)) folded.open = false;
    redrawAll();
  });
}

function prepareTables() {
  for (const table of document.querySelectorAll("table.sortable")) makeSortable(table);
  for (const field of document.querySelectorAll("input.filter")) {
    const table = document.getElementById(field.dataset.table);
    makeFilterable(table, field, document.getElementById(`${field.id}-status`));
  }
}

/** Draw the terms of each variable, with a line where it is now. */
function fillPictures(section, state) {
  for (const picture of section.querySelectorAll(".picture")) {
    const { kind, place } = picture.dataset;
    const variable = state.system[kind][Number(place)];
    const mark = () => {
      const { clipped, outputs } = state.inference;
      const value = kind === "inputs" ? clipped[place] : outputs[place].value;
      if (!Number.isFinite(value)) return chart.over.replaceChildren();
      const x = chart.x(value);
      chart.over.replaceChildren(draw("line", { class: "cursor", x1: x, x2: x, y1: chart.y(0), y2: chart.y(1) }));
    };
    const chart = membershipChart(variable, `Membership functions of ${variable.name}`, CHART.plotHeight, mark);
    picture.append(chart.svg, chart.zooming);
    state.follow(mark);
  }
}

function fillSystem(state, place, clock, scale, quadrature) {
  const id = `s${place + 1}`;
  const section = document.getElementById(id);
  const live = (name) => section.querySelector(`.live.${name}`);
  fillPictures(section, state);
  inferenceView(live("inference"), state, id, quadrature);
  followRules(section, state);
  if (state.system.inputs.length > 1) surfaceView(live("surface"), state, scale, id);
  else curveView(live("surface"), state);
  if (clock.flights.length) flightView(live("flight"), state, place, clock, scale);
}

/** Let the buttons of findings set the inputs at which each can be seen. */
function showPoints(states) {
  for (const button of document.querySelectorAll("button.show-point")) {
    button.addEventListener("click", () => {
      const state = states[Number(button.dataset.system) - 1];
      const point = JSON.parse(button.dataset.point);
      state.setInputs(state.system.inputs.map(({ name }, place) => point[name] ?? state.inputs[place]));
      const place = document.getElementById(`s${button.dataset.system}-inference`);
      place.closest("details").open = true;
      place.scrollIntoView();
    });
  }
}

const carried = readCarried();
const states = carried.systems.map((system) => new SystemState(system));
followTheme();
followPrinting();
prepareTables();
const clock = new FlightClock(carried.flights, carried.noun);
if (document.getElementById("player")) clock.followPlayer();
const scale = brightnessScale(carried.brightness);
states.forEach((state, place) => fillSystem(state, place, clock, scale, carried.quadrature));
showPoints(states);
followSignature(carried);
addEventListener("resize", oncePerFrame(redrawAll));
document.addEventListener("toggle", redrawAll, true);
// for whoever looks at the page with a browser's console
window.review = Object.freeze({ systems: carried.systems, states, infer, contributions, shares, signChange, quadrature: carried.quadrature });

// What happened in a flight, bout by bout of a rule, as a list that follows the time.

/** The bouts of a flight: {first, last, count, why, rows}, as its `why` and `reasons` give them; decisions in a row by one rule are one.
 *
 * Between two decisions a safety layer may push, what was planned, or thrusters that fire late. */
function boutsOf(flight) {
  const bouts = [];
  for (let k = 0; k < flight.numSamples - 1; k++) {
    if (!flight.force(k).some(Boolean)) continue;
    const why = flight.why(k), before = bouts.at(-1);
    if (before?.why === why && k - before.last <= 2 * flight.stride) Object.assign(before, { last: k, count: before.count + 1 });
    else bouts.push({ first: k, last: k, count: 1, why, rows: flight.reasons(k) });
  }
  return bouts;
}

/** List the bouts; returned is what marks the one at a sample. `go(k)` moves the page's time. */
function boutsList(box, flight, go) {
  const bouts = boutsOf(flight), time = k => clockWords(k * flight.periodS);
  const buttons = bouts.map(({ first, last, count, why, rows }) => make("button", { type: "button", click: () => go(first) },
    make("b", {}, `${time(first)} · ${rows.map(({ text }) => text).join(" ")}`), count > 1 ? ` and ${count - 1} more until ${time(last)}` : "", make("br"), why));
  const list = make("ol", { class: "bouts", tabindex: 0, "aria-label": `Pushes and their reasons${flight.of}` }, ...buttons.map(button => make("li", {}, button)));
  box.replaceChildren(make("h4", {}, bouts.length ? `Why: ${bouts.length} ${bouts.length === 1 ? "bout" : "bouts"} of pushes` : "No push in this flight"), ...(bouts.length ? [list] : []));
  return k => {
    const now = bouts.findLastIndex(({ first }) => first <= k);
    buttons.forEach((button, index) => {
      if (index !== now) button.removeAttribute("aria-current");
      else if (!button.hasAttribute("aria-current")) {
        button.setAttribute("aria-current", "step");
        list.scrollTop = Math.max(0, button.parentElement.offsetTop - 60);
      }
    });
  };
}

// What happened in a flight, bout by bout of a rule, as a list that follows the time.

/** Why the pushes of a sample came: what is said once of several stands at the last. */
const whyOf = rows => rows.find(({ detail }) => detail)?.detail ?? "";

/** The bouts of a flight: {first, last, count, rows}, rows as `reasons` gives them; decisions in a row by one rule are one. */
function boutsOf(flight) {
  const bouts = [];
  for (let k = 0; k < flight.numSamples - 1; k += flight.stride) {
    if (!flight.force(k).some(Boolean)) continue;
    const rows = flight.reasons(k), before = bouts.at(-1);
    if (before && whyOf(before.rows) === whyOf(rows) && k - before.last <= 2 * flight.stride) Object.assign(before, { last: k, count: before.count + 1 });
    else bouts.push({ first: k, last: k, count: 1, rows });
  }
  return bouts;
}

/** List the bouts; returned is what marks the one at a sample. `go(k)` moves the page's time. */
function boutsList(box, flight, go) {
  const bouts = boutsOf(flight), time = k => clockWords(k * flight.periodS);
  const buttons = bouts.map(({ first, last, count, rows }) => make("button", { type: "button", click: () => go(first) },
    make("b", {}, `${time(first)} · ${rows.map(({ text }) => text).join(" ")}`), count > 1 ? ` and ${count - 1} more until ${time(last)}` : "", make("br"), whyOf(rows)));
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

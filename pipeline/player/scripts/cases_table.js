// The cases as a table by any column, of which each row opens its flight.

const NUM_ROWS = 8;

/** Fill a box with the table; returned is what marks a case. */
function casesTable(box, cases, open) {
  let sorted = cases.columns[0].name, isFalling = true, first = 0, chosen = null;
  const valuesOf = name => (name === "case" ? cases.numbers : cases.columns.find(column => column.name === name).values);
  const show = () => {
    const values = valuesOf(sorted), order = Array.from({ length: cases.count }, (_, row) => row);
    order.sort((a, b) => (isFalling ? values[b] - values[a] : values[a] - values[b]) || a - b);
    const sortBy = name => () => { isFalling = name === sorted ? !isFalling : true; sorted = name; first = 0; show(); };
    const heads = [{ name: "case", label: "case" }, ...cases.columns].map(({ name, label }) => make("th", { scope: "col", "aria-sort": name !== sorted ? "none" : isFalling ? "descending" : "ascending" },
      make("button", { type: "button", click: sortBy(name) }, `${label}${name !== sorted ? "" : isFalling ? " ↓" : " ↑"}`)));
    const rows = order.slice(first, first + NUM_ROWS).map(row => make("tr", { class: row === chosen ? "now" : null },
      make("td", {}, make("button", { type: "button", "aria-label": `Open case ${cases.numbers[row]}`, click: () => open(row) }, String(cases.numbers[row]))),
      ...cases.columns.map(({ values: of, decimals }) => make("td", {}, of[row].toFixed(decimals).replace("-", "−"))),
      make("td", {}, cases.isGood(row) ? "yes" : "no")));
    const turn = (words, to) => make("button", { type: "button", class: "plain", "aria-label": words, click: () => { first = Math.min(Math.max(0, to), Math.max(0, cases.count - NUM_ROWS)); show(); } }, words === "Earlier rows" ? "‹" : "›");
    box.replaceChildren(make("h4", {}, `${cases.count.toLocaleString("en")} cases: press one to open its flight`),
      make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Cases" }, make("table", {}, make("thead", {}, make("tr", {}, ...heads, make("th", { scope: "col" }, "succeeds"))), make("tbody", {}, ...rows))),
      make("p", { class: "small" }, turn("Earlier rows", first - NUM_ROWS), ` ${first + 1} to ${first + rows.length} `, turn("Later rows", first + NUM_ROWS)));
  };
  show();
  return row => { chosen = row; show(); };
}

// The cases as a table by any column, of which each row opens its flight. Few cases may have words of their own.

const NUM_ROWS = 8;

/** Fill a box with the table; returned is what marks a case. */
function casesTable(box, cases, open) {
  const columns = cases.columns.filter(({ isTold }) => isTold);
  let sorted = cases.words.length ? "case" : columns[0].name, isFalling = !cases.words.length, first = 0, chosen = null;
  const valuesOf = name => (name === "case" ? cases.numbers : columns.find(column => column.name === name).values);
  const isAlone = cases.succeeds.length === 1;
  // of several runs, which fail
  const outcomeOf = row => (isAlone ? (cases.succeeds[0](row) ? "yes" : "no") : cases.letters.filter((_, at) => !cases.succeeds[at](row)).join(" ") || "–");
  const show = () => {
    const values = valuesOf(sorted), order = Array.from({ length: cases.count }, (_, row) => row);
    order.sort((a, b) => (isFalling ? values[b] - values[a] : values[a] - values[b]) || a - b);
    const sortBy = name => () => { isFalling = name === sorted ? !isFalling : true; sorted = name; first = 0; show(); };
    const heads = [{ name: "case", label: "case" }, ...columns].map(({ name, label }) => make("th", { scope: "col", "aria-sort": name !== sorted ? "none" : isFalling ? "descending" : "ascending" },
      make("button", { type: "button", click: sortBy(name) }, `${label}${name !== sorted ? "" : isFalling ? " ↓" : " ↑"}`)));
    const rows = order.slice(first, first + NUM_ROWS).map(row => make("tr", { class: row === chosen ? "now" : null },
      make("td", {}, make("button", { type: "button", "aria-label": `Open case ${cases.numbers[row]}`, click: () => open(row) }, String(cases.numbers[row]))),
      ...(cases.words.length ? [make("td", { class: "said-of" }, cases.words[row])] : []),
      ...columns.map(({ values: of, decimals }) => make("td", {}, of[row].toFixed(decimals).replace("-", "−"))),
      make("td", {}, outcomeOf(row))));
    const turn = (words, to) => make("button", { type: "button", class: "plain", "aria-label": words, click: () => { first = Math.min(Math.max(0, to), Math.max(0, cases.count - NUM_ROWS)); show(); } }, words === "Earlier rows" ? "‹" : "›");
    if (cases.words.length) heads.splice(1, 0, make("th", { scope: "col", class: "said-of" }, "which"));
    const outcomes = make("th", { scope: "col" }, isAlone ? cases.outcome[0] : cases.outcome[2]);
    const number = cases.count > 1 ? `${cases.count.toLocaleString("en")} cases: press one to open its flight` : "One case";
    box.replaceChildren(make("h4", {}, number),
      make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Cases" }, make("table", {}, make("thead", {}, make("tr", {}, ...heads, outcomes)), make("tbody", {}, ...rows))),
      cases.count > NUM_ROWS && make("p", { class: "small" }, turn("Earlier rows", first - NUM_ROWS), ` ${first + 1} to ${first + rows.length} `, turn("Later rows", first + NUM_ROWS)) || "");
  };
  show();
  return row => { chosen = row; show(); };
}

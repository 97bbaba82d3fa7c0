// Tables that sort by a column and show only the rows with some words.

/** What a cell is sorted by: its number where it has one, else its words. */
function sortKey(row, column) {
  const cell = row.cells[column];
  return "value" in cell.dataset ? Number(cell.dataset.value) : cell.textContent.trim();
}

function compare(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b), "en", { numeric: true });
}

/** Sort the rows of a table by a column; the head of the column says so. */
function sortBy(table, column, isDescending) {
  const body = table.tBodies[0];
  const factor = isDescending ? -1 : 1;
  const rows = [...body.rows].map((row, place) => ({ row, place, key: sortKey(row, column) }));
  rows.sort((a, b) => factor * compare(a.key, b.key) || a.place - b.place);
  body.append(...rows.map(({ row }) => row));
  [...table.tHead.rows[0].cells].forEach((head, place) => {
    if (place === column) head.setAttribute("aria-sort", isDescending ? "descending" : "ascending");
    else head.removeAttribute("aria-sort");
  });
}

/** Sort again by the column that a table is sorted by, if its values have changed. */
function sortAgain(table, column) {
  const now = table.tHead.rows[0].cells[column].getAttribute("aria-sort");
  if (now) sortBy(table, column, now === "descending");
}

/** Let each head of a table sort by its column, with a button for the keyboard; a click anywhere in it does. */
function makeSortable(table) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const words = head.textContent.trim();
    // without the button in it, which readers would read with every cell
    head.setAttribute("aria-label", words);
    head.append(" ", make("button", { type: "button", class: "sort", "aria-label": `Sort by ${words}` }));
    head.addEventListener("click", () => {
      const now = head.getAttribute("aria-sort");
      sortBy(table, column, now ? now === "ascending" : head.dataset.first === "descending");
    });
  });
}

/** Show only rows that hold all of the words in a field. */
function makeFilterable(table, field, status) {
  const rows = [...table.tBodies[0].rows];
  const contents = rows.map((row) => row.textContent.toLowerCase());
  const filter = () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    rows.forEach((row, i) => {
      row.hidden = !words.every((word) => contents[i].includes(word));
      count += row.hidden ? 0 : 1;
    });
    status.textContent = words.length ? `${count} of ${rows.length} shown` : "";
  };
  field.addEventListener("input", filter);
  const showAll = () => {
    field.value = "";
    filter();
  };
  // a link to a row that is filtered away shows it
  document.addEventListener("click", ({ target }) => {
    const link = target.closest?.("a[href^='#']");
    const row = link && document.getElementById(link.hash.slice(1));
    if (row?.hidden && rows.includes(row)) showAll();
  });
}

// Pictures and numbers of a page as files.

const COLOUR_NAMES = ["ink", "muted", "grid", "paper", "seen", "lit", "dark", "push", "accent", "card"];

function download(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Return the colours of the page as it is shown now, by the names of its variables. */
function coloursOf(element) {
  const probe = make("span", { hidden: true });
  element.append(probe);
  const found = Object.fromEntries(COLOUR_NAMES.map(name => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  }));
  probe.remove();
  return found;
}

/** Return a drawing as a file of its own, in the colours that it has on the page. */
function standalone(drawing) {
  const copy = drawing.cloneNode(true), [, , width, height] = drawing.getAttribute("viewBox").split(" ");
  const variables = Object.entries(coloursOf(drawing.parentElement)).map(([name, colour]) => `--${name}:${colour}`).join(";");
  const style = `svg{${variables};background:var(--card)}text{font:11px sans-serif;fill:var(--muted)}`;
  Object.entries({ xmlns: SVG, width, height }).forEach(([name, value]) => copy.setAttribute(name, value));
  copy.prepend(draw("style", {}, style));
  return new XMLSerializer().serializeToString(copy);
}

function savePng(name, drawing) {
  const [, , width, height] = drawing.getAttribute("viewBox").split(" ").map(Number), picture = new Image();
  picture.onload = () => {
    const canvas = make("canvas", { width: 3 * width, height: 3 * height });
    canvas.getContext("2d").drawImage(picture, 0, 0, 3 * width, 3 * height);
    canvas.toBlob(blob => download(`${name}.png`, blob));
  };
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(standalone(drawing))}`;
}

/** Return CSV of columns, each a list with a name. */
function csvOf(columns) {
  const longest = Math.max(...columns.map(([, values]) => values.length));
  const rows = Array.from({ length: longest }, (_, row) => columns.map(([, values]) => values[row] ?? "").join(","));
  return [columns.map(([name]) => name).join(","), ...rows].join("\n");
}

/** Buttons that save a drawing or its numbers; `name()` is of the file, `columns()` of the numbers. */
function savingButtons(title, name, drawing, columns) {
  const button = (words, work) => make("button", { type: "button", class: "plain", "aria-label": `${words} of ${title}`, click: work }, words);
  return make("div", { class: "tools" },
    ...(drawing ? [
      button("SVG", () => download(`${name()}.svg`, new Blob([standalone(drawing())], { type: "image/svg+xml" }))),
      button("PNG", () => savePng(name(), drawing())),
    ] : []),
    button("CSV", () => download(`${name()}.csv`, new Blob([csvOf(columns())], { type: "text/csv" }))));
}

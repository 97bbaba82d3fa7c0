// All cases as dots, of which each opens its flight; and how a quantity spreads, whose bars open theirs.

const DOTS = { left: 48, right: 10, top: 24, bottom: 36, reach: 24 };

/**
 * A scatter of two columns on a canvas; returned is what marks a case. `cases` has count, numbers and isGood.
 *
 * Where the columns are the same of two runs, axes are alike, with a line where both are equal.
 */
function scatter(box, { title, isPaired }, [xColumn, yColumn], cases, open, fileName) {
  const canvas = make("canvas", { tabindex: 0, role: "application", "aria-label": `${title}: arrow keys go from case to case by ${xColumn.label}, Enter opens its flight` });
  const tip = make("div", { class: "tip", hidden: true }), said = make("p", { class: "unseen", "aria-live": "polite" }), pen = canvas.getContext("2d");
  const X = xColumn.values, Y = yColumn.values, order = Array.from(X.keys()).sort((a, b) => X[a] - X[b]);
  const whole = values => { const [low, high] = extremes(Array.from(values)), room = 0.04 * (high - low || Math.abs(high) || 1); return [low - room, high + room]; };
  const both = isPaired ? [whole([...X, ...Y]), whole([...X, ...Y])] : [whole(X), whole(Y)];
  let zoom = both, hovered = null, chosen = null, x = null, y = null;
  const again = make("button", { type: "button", class: "plain", click: () => { zoom = both; paint(); } }, "whole");
  const save = savingButtons(title, fileName, null, () => [["case", Array.from(cases.numbers)], [xColumn.name, Array.from(X)], [yColumn.name, Array.from(Y)]]);
  save.prepend(again);
  box.replaceChildren(save, make("h4", {}, title), make("div", { class: "dots" }, canvas, tip), said);

  const axes = (width, height, colours) => {
    Object.assign(pen, { font: "12px system-ui", fillStyle: colours.muted, strokeStyle: colours.grid, lineWidth: 1, textAlign: "center" });
    for (const value of ticks(...zoom[0], 5)) { pen.fillText(shown(value), x(value), height - 20); pen.strokeRect(x(value), DOTS.top, 0, height - DOTS.top - DOTS.bottom); }
    pen.fillText(xColumn.label, width / 2, height - 4);
    pen.textAlign = "right";
    for (const value of ticks(...zoom[1], 5)) { pen.fillText(shown(value), DOTS.left - 5, y(value) + 4); pen.strokeRect(DOTS.left, y(value), width - DOTS.left - DOTS.right, 0); }
    pen.textAlign = "left";
    pen.fillText(yColumn.label, 2, 12);
  };
  const equality = colour => {
    const ends = zoom.flat(), [low, high] = [Math.min(...ends), Math.max(...ends)];
    pen.beginPath(); pen.moveTo(x(low), y(low)); pen.lineTo(x(high), y(high)); pen.strokeStyle = colour; pen.lineWidth = 1; pen.stroke();
  };
  const mark = (row, colour) => { pen.beginPath(); pen.arc(x(X[row]), y(Y[row]), 7, 0, 2 * Math.PI); pen.strokeStyle = colour; pen.lineWidth = 2.5; pen.stroke(); };
  const paint = () => {
    const { clientWidth: width, clientHeight: height } = canvas, ratio = devicePixelRatio || 1, colours = coloursOf(box);
    if (!width) return;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    x = linear(...zoom[0], DOTS.left, width - DOTS.right);
    y = linear(...zoom[1], height - DOTS.bottom, DOTS.top);
    axes(width, height, colours);
    pen.save();
    pen.beginPath();
    pen.rect(DOTS.left - 3, DOTS.top - 3, width - DOTS.left - DOTS.right + 6, height - DOTS.top - DOTS.bottom + 6);
    pen.clip();
    if (isPaired) equality(colours.muted);
    pen.globalAlpha = 0.55;
    for (let row = 0; row < cases.count; row++) { // failures are squares, and drawn last
      if (!cases.isGood(row)) continue;
      pen.fillStyle = colours.seen; pen.beginPath(); pen.arc(x(X[row]), y(Y[row]), 2.6, 0, 2 * Math.PI); pen.fill();
    }
    pen.fillStyle = colours.push;
    for (let row = 0; row < cases.count; row++) if (!cases.isGood(row)) pen.fillRect(x(X[row]) - 3.5, y(Y[row]) - 3.5, 7, 7);
    pen.globalAlpha = 1;
    if (chosen !== null) mark(chosen, colours.accent);
    if (hovered !== null) mark(hovered, colours.ink);
    pen.restore();
    tip.hidden = hovered === null;
    if (hovered === null) return;
    tip.textContent = `case ${cases.numbers[hovered]}: ${shown(X[hovered])}, ${shown(Y[hovered])}`;
    tip.style.left = `${Math.min(Math.max(x(X[hovered]), 80), width - 80)}px`;
    tip.style.top = `${Math.max(36, y(Y[hovered]))}px`;
  };
  const nearest = ({ offsetX, offsetY }) => {
    let best = null, least = DOTS.reach ** 2;
    for (let row = 0; row < cases.count; row++) {
      const far = (x(X[row]) - offsetX) ** 2 + (y(Y[row]) - offsetY) ** 2;
      if (far < least) [least, best] = [far, row];
    }
    return best;
  };
  const hover = row => { if (row !== hovered) { hovered = row; painted(); } };
  const painted = oncePerFrame(paint);
  canvas.addEventListener("pointermove", event => hover(nearest(event)));
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("click", event => { const row = nearest(event); if (row !== null) open(row); });
  canvas.addEventListener("wheel", event => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    const factor = Math.exp(event.deltaY / 400);
    const centres = [linear(DOTS.left, canvas.clientWidth - DOTS.right, ...zoom[0])(event.offsetX), linear(canvas.clientHeight - DOTS.bottom, DOTS.top, ...zoom[1])(event.offsetY)];
    zoom = zoom.map((ends, axis) => ends.map(end => centres[axis] + (end - centres[axis]) * factor));
    painted();
  }, { passive: false });
  canvas.addEventListener("keydown", event => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -50, PageDown: 50 }[event.key];
    if (step) {
      event.preventDefault();
      const at = order.indexOf(hovered ?? chosen ?? order[0]);
      hovered = order[Math.min(Math.max(at + step, 0), cases.count - 1)];
      paint();
      said.textContent = tip.textContent;
    } else if (event.key === "Enter" && hovered !== null) open(hovered);
  });
  new ResizeObserver(painted).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", painted);
  document.getElementById("theme")?.addEventListener("change", painted);
  return { mark: row => { chosen = row; painted(); }, where: row => [x(X[row]), y(Y[row])] };
}

/** Bars of how a column spreads; a bar opens its case nearest to the middle, and again the next. */
function histogram(box, { title }, [column], cases, open, fileName, count = 20) {
  const [low, high] = extremes(Array.from(column.values)), step = (high - low || 1) / count;
  const bins = Array.from({ length: count }, () => []);
  column.values.forEach((value, row) => bins[Math.min(count - 1, Math.floor((value - low) / step))].push(row));
  const width = Math.max(260, box.clientWidth - 26), { height, left, right, top, bottom } = PLOT, floor = height - bottom;
  const most = Math.max(...bins.map(({ length }) => length));
  const x = linear(low, low + step * count, left, width - right), y = linear(0, most, floor, top);
  const bars = bins.map((rows, bin) => {
    let turn = 0;
    const next = () => { open(rows[turn % rows.length]); turn += 1; };
    const words = `${rows.length} cases from ${shown(low + bin * step, 3)} to ${shown(low + (bin + 1) * step, 3)}`;
    return rows.length && draw("rect", {
      x: x(low + bin * step) + 0.5, width: Math.max(1, x(low + step) - x(low) - 1), y: y(rows.length), height: floor - y(rows.length),
      class: "bar", tabindex: 0, role: "button", "aria-label": `${words}: open one`, click: next,
      keydown: event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); next(); } },
    }, draw("title", {}, words));
  });
  const drawing = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "group", "aria-label": `${title}: bars open cases` },
    ...ticks(0, most, 3).map(value => draw("text", { x: left - 5, y: y(value) + 4, "text-anchor": "end" }, shown(value))),
    ...ticks(low, high, 5).map(value => draw("text", { x: x(value), y: height - 10, "text-anchor": "middle" }, shown(value, 3))),
    draw("text", { x: width - right, y: top - 9, "text-anchor": "end" }, column.label), ...bars.filter(Boolean));
  const columns = () => [["from", bins.map((_, bin) => low + bin * step)], ["to", bins.map((_, bin) => low + (bin + 1) * step)], ["cases", bins.map(({ length }) => length)]];
  box.replaceChildren(savingButtons(title, fileName, () => drawing, columns), make("h4", {}, title), drawing);
  return row => bars.forEach((bar, bin) => { if (bar) bar.classList.toggle("now", bins[bin].includes(row)); });
}

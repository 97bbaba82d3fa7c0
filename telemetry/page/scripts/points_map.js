// The chief's points unrolled: along the orbit plane from behind to ahead, and across it.

const MAP = { width: 360, height: 176, radius: 4.2 };
const inDegrees = angle => angle * 180 / Math.PI;

/** Where a direction lies on the map. */
function mapped([x, y, z]) {
  const latitude = inDegrees(Math.asin(Math.max(-1, Math.min(1, z / Math.hypot(x, y, z)))));
  return [MAP.width / 2 + inDegrees(Math.atan2(y, x)), MAP.height / 2 * (1 - latitude / 90)];
}

/** Draw the map; returned is what shows a sample. `go(k)` moves the page's time. */
function pointsMap(box, flight, seenAt, go, fileName) {
  const drawing = draw("svg", { viewBox: `-6 -6 ${MAP.width + 12} ${MAP.height + 24}`, role: "img", "aria-label": `Map of the chief's points${flight.of}` },
    draw("rect", { width: MAP.width, height: MAP.height, fill: "none", stroke: "var(--grid)" }));
  const shapes = flight.points.map((point, j) => {
    const title = draw("title"), [cx, cy] = mapped(point);
    const shape = draw("circle", { cx, cy, "stroke-width": 1.6, click: () => { if (seenAt[j] !== null) go(seenAt[j]); } }, title);
    title.textContent = seenAt[j] === null ? `point ${j}: never inspected` : `point ${j}: inspected at ${clockWords(seenAt[j] * flight.periodS)}${flight.seenBy ? `, first by ${flight.seenBy[j]}` : ""}`;
    drawing.append(shape);
    return shape;
  });
  const deputy = draw("path", { fill: "none", stroke: "var(--push)", "stroke-width": 2.2, d: "M-6,0H6M0,-6V6" });
  const sun = draw("circle", { r: 6, fill: "var(--lit)", stroke: "var(--card)" });
  drawing.append(deputy, sun, ...[["back", 90], ["up", 180], ["ahead", 270]].map(([word, x]) => draw("text", { x, y: MAP.height + 12, "text-anchor": "middle" }, word)));
  const columns = () => [["point", flight.points.map((_, j) => j)], ["inspected_s", seenAt.map(k => (k === null ? "" : k * flight.periodS))]];
  const about = `Large: inspected. ${flight.isLit ? "Ring: lit. " : ""}Small: ${flight.isLit ? "dark" : "not yet"}. Cross: the deputy. Press a point to go to when it was inspected.${flight.atStart ? " As at the start: the chief turns." : ""}`;
  const onMap = (k, vector) => mapped(flight.atStart?.(k, vector) ?? vector);
  box.replaceChildren(savingButtons("the points", fileName, () => drawing, columns), make("h4", {}, "The chief's points, unrolled"), drawing, make("p", { class: "small" }, about));
  return k => {
    shapes.forEach((shape, j) => {
      const isSeen = flight.isSeen(k, j), isLit = !isSeen && flight.isLit?.(k, j);
      shape.setAttribute("r", isSeen || isLit ? MAP.radius : MAP.radius / 2);
      shape.setAttribute("fill", isSeen ? "var(--seen)" : isLit ? "var(--card)" : "var(--dark)");
      shape.setAttribute("stroke", isSeen ? "var(--seen)" : isLit ? "var(--lit)" : "none");
    });
    const [x, y] = onMap(k, flight.position(k)), light = flight.sun(k), [sunX, sunY] = light ? onMap(k, light) : [-100, 0];
    deputy.setAttribute("transform", `translate(${x},${y})`);
    sun.setAttribute("cx", sunX);
    sun.setAttribute("cy", sunY);
  };
}

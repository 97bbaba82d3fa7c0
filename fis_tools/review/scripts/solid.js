// An output over two inputs as a surface in space, which a mouse or the arrow keys turn.

const HALF_HEIGHT = 0.62;
const FIRST_VIEW = { azimuth: -0.65, elevation: 0.5 };

/** A parallel projection: from [-1, 1]^3 to the canvas, and how far a point lies behind the middle. */
function projection(view, width, height) {
  const [sinA, cosA] = [Math.sin(view.azimuth), Math.cos(view.azimuth)];
  const [sinE, cosE] = [Math.sin(view.elevation), Math.cos(view.elevation)];
  const unit = Math.min((width - 110) / 2.85, (height - 60) / 2.35);
  const along = (x, y) => x * sinA + y * cosA;
  return {
    screen: (x, y, z) => [
      width / 2 + 6 + unit * (x * cosA - y * sinA),
      height / 2 - 6 - unit * (z * cosE + along(x, y) * sinE),
    ],
    width,
    depth: (x, y, z) => along(x, y) * cosE - z * sinE,
    backX: sinA > 0 ? 1 : -1,
    backY: cosA > 0 ? 1 : -1,
  };
}

function polygon(context, points) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
}

/** The scales of the box: from values to [-1, 1] along x and y and to its height along z. */
function boxScales({ xVariable, yVariable, low, high }) {
  const flat = high > low ? 0 : Math.abs(high) || 1;
  return {
    x: linear(xVariable.minimum, xVariable.maximum, -1, 1),
    y: linear(yVariable.minimum, yVariable.maximum, -1, 1),
    z: linear(low - flat, high + flat, -HALF_HEIGHT, HALF_HEIGHT),
    zTicks: ticks(low - flat, high + flat, 4),
  };
}

/** Draw the floor and the two walls behind, with lines at the ticks. */
function paintBox(context, response, scales, { screen, backX, backY }, colours) {
  const [h, xs, ys] = [HALF_HEIGHT, scales.x, scales.y];
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  const line = (...points) => {
    polygon(context, points.map((point) => screen(...point)));
    context.stroke();
  };
  for (const value of ticks(response.xVariable.minimum, response.xVariable.maximum, 4)) {
    line([xs(value), -backY, -h], [xs(value), backY, -h], [xs(value), backY, h]);
  }
  for (const value of ticks(response.yVariable.minimum, response.yVariable.maximum, 4)) {
    line([-backX, ys(value), -h], [backX, ys(value), -h], [backX, ys(value), h]);
  }
  for (const value of scales.zTicks) {
    line([-backX, backY, scales.z(value)], [backX, backY, scales.z(value)], [backX, -backY, scales.z(value)]);
  }
  context.strokeStyle = colours.muted;
  line([-backX, -backY, -h], [backX, -backY, -h], [backX, backY, -h], [-backX, backY, -h], [-backX, -backY, -h]);
  line([-backX, backY, -h], [-backX, backY, h], [backX, backY, h], [backX, -backY, h], [backX, -backY, -h]);
  line([backX, backY, -h], [backX, backY, h]);
}

/** Write the ticks and the title of one edge of the box, on its outer side. */
function labelEdge(context, { screen, width }, edge, colours) {
  const [x0, y0] = screen(...edge.inside);
  const [x1, y1] = screen(...edge.at(edge.values[0].place));
  const [xe, ye] = screen(...edge.at(edge.values.at(-1).place));
  const [mx, my] = [(x1 + xe) / 2 - x0, (y1 + ye) / 2 - y0];
  const length = Math.hypot(mx, my) || 1;
  const [ox, oy] = [mx / length, my / length];
  context.textAlign = ox < -0.35 ? "right" : ox > 0.35 ? "left" : "center";
  context.fillStyle = colours.muted;
  let widest = 0;
  for (const { place, text } of edge.values) {
    const [x, y] = screen(...edge.at(place));
    context.fillText(text, x + 9 * ox, y + 11 * oy + 4);
    widest = Math.max(widest, context.measureText(text).width);
  }
  context.fillStyle = colours.ink;
  const [tx, ty] = screen(...edge.at(0));
  if (edge.isUpright) turnedText(context, edge.title, tx - widest - 22, ty);
  else {
    const half = context.measureText(edge.title).width / 2;
    const middle = tx + (20 + widest) * ox + half * Math.sign(ox) * (context.textAlign === "center" ? 0 : 1);
    context.textAlign = "center";
    context.fillText(edge.title, Math.min(Math.max(middle, half + 3), width - half - 3), ty + 30 * oy + 4);
  }
}

function labelBox(context, response, scales, view, colours) {
  const { screen, backX, backY } = view;
  const values = (variable, scale) =>
    ticks(variable.minimum, variable.maximum, 4).map((value) => ({ place: scale(value), text: shown(value) }));
  const floor = [0, 0, -HALF_HEIGHT];
  const xEdge = { at: (place) => [place, -backY, -HALF_HEIGHT], values: values(response.xVariable, scales.x) };
  const yEdge = { at: (place) => [-backX, place, -HALF_HEIGHT], values: values(response.yVariable, scales.y) };
  labelEdge(context, view, { ...xEdge, inside: floor, title: withUnit(response.xVariable) }, colours);
  labelEdge(context, view, { ...yEdge, inside: floor, title: withUnit(response.yVariable) }, colours);
  const corners = [[backX, -backY], [-backX, backY]];
  const leftmost = corners.reduce((a, b) => (screen(...a, 0)[0] <= screen(...b, 0)[0] ? a : b));
  const zValues = scales.zTicks.map((value) => ({ place: scales.z(value), text: shown(value, 3) }));
  const zEdge = { at: (place) => [...leftmost, place], values: zValues, inside: [0, 0, 0], isUpright: true };
  labelEdge(context, view, { ...zEdge, title: withUnit(response.variable) }, colours);
}

/** The cells of the surface, the farthest first. */
function cellsByDepth(response, scales, { screen, depth }) {
  const { x, y, values } = response;
  const [xs, ys] = [x.map(scales.x), y.map(scales.y)];
  const corners = values.map((row, i) => row.map((value, j) => screen(xs[j], ys[i], scales.z(value))));
  const cells = [];
  for (let i = 0; i + 1 < y.length; i++) {
    for (let j = 0; j + 1 < x.length; j++) {
      const [a, b, c, d] = cornersOf(values, i, j);
      const mean = (a + b + c + d) / 4;
      const behind = depth((xs[j] + xs[j + 1]) / 2, (ys[i] + ys[i + 1]) / 2, scales.z(mean));
      cells.push({ i, j, mean, behind, points: cornersOf(corners, i, j) });
    }
  }
  return cells.sort((a, b) => b.behind - a.behind);
}

const MESH_STEP = 4;

function paintSurface(context, response, cells, scale) {
  const part = linear(response.low, response.high, 0, 1);
  for (const { i, j, mean, points } of cells) {
    polygon(context, points);
    context.closePath();
    context.fillStyle = context.strokeStyle = rgb(scale(part(mean)));
    context.lineWidth = 0.8;
    context.fill();
    context.stroke();
    context.strokeStyle = part(mean) < 0.5 ? "rgba(255,255,255,.35)" : "rgba(0,0,0,.35)";
    if (i % MESH_STEP === 0) polygon(context, [points[0], points[1]]), context.stroke();
    if (j % MESH_STEP === 0) polygon(context, [points[0], points[3]]), context.stroke();
    if (response.low < 0 && response.high > 0) paintZero(context, cornersOf(response.values, i, j), points);
  }
}

/** Draw where the output is zero, in one cell. */
function paintZero(context, corners, [a, b, c, d]) {
  context.strokeStyle = "#000000";
  context.lineWidth = 1.8;
  const point = (x, y) => [0, 1].map((k) => (1 - y) * ((1 - x) * a[k] + x * b[k]) + y * ((1 - x) * d[k] + x * c[k]));
  for (const [x1, y1, x2, y2] of contourInCell(corners, 0)) {
    polygon(context, [point(x1, y1), point(x2, y2)]);
    context.stroke();
  }
}

/** Draw the surface as seen from `view`; each point holds an x, a y and an output: the present one, one pointed at. */
function paintSolid(canvas, response, scale, view, points) {
  const { context, width, height } = sharpContext(canvas);
  const colours = themeColours();
  const scales = boxScales(response);
  const projected = projection(view, width, height);
  paintBox(context, response, scales, projected, colours);
  paintSurface(context, response, cellsByDepth(response, scales, projected), scale);
  labelBox(context, response, scales, projected, colours);
  for (const point of points) {
    const [x, y] = [scales.x(point[0]), scales.y(point[1])];
    if (Math.max(Math.abs(x), Math.abs(y)) > 1 + 1e-9) continue;
    const top = projected.screen(x, y, scales.z(Math.min(Math.max(point[2], response.low), response.high)));
    paintMark(context, ...top, colours);
  }
}

/** Let a mouse, a finger or the arrow keys turn a view; `changed` draws it again. */
function makeTurnable(canvas, view, changed) {
  let last = null;
  const turn = (azimuth, elevation) => {
    view.azimuth += azimuth;
    view.elevation = Math.min(Math.max(view.elevation + elevation, 0.02), Math.PI / 2);
    changed();
  };
  canvas.addEventListener("pointerdown", (event) => {
    last = event;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return;
    turn(-(event.clientX - last.clientX) / 120, (event.clientY - last.clientY) / 120);
    last = event;
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (last = null));
  canvas.addEventListener("keydown", (event) => {
    const moves = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.08], ArrowDown: [0, 0.08] };
    if (event.ctrlKey || event.altKey || event.metaKey) return; // the browser's own
    if (event.key === "Home") Object.assign(view, FIRST_VIEW);
    else if (!(event.key in moves)) return;
    event.preventDefault();
    turn(...(moves[event.key] ?? [0, 0]));
  });
}

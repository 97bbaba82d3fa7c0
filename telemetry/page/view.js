// A flight in three dimensions on a canvas: the path about the chief, its points, the Sun, and each push with its reason.

const TURN = 2 * Math.PI, AXES = [["down", "up"], ["back", "ahead"], ["south", "north"]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const norm = a => Math.sqrt(dot(a, a));
export const scaled = (a, s) => a.map(x => x * s);
export const plus = (a, b) => a.map((x, i) => x + b[i]);
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => scaled(a, 1 / (norm(a) || 1));
const COLOURS = ["ink", "muted", "grid", "paper", "seen", "lit", "dark", "push", "body", "shade"];
const EYE_M = 700, NEAREST = 0.9; // how far the eye is from the chief at least, and of that how near to it a path is drawn
const SPEED = 18; // samples a second

/**
 * Show a flight in an element that holds a canvas, `.play`, `.time`, `.count` and `.why`.
 *
 * `flight` has numSamples, periodS, radius, limits, points and, of a sample k, position, velocity, force, sun (a
 * direction, or null where none is told), isSeen(k, point), spent, coast(k) (positions of free motion), and reasons(k) (lists of {text, detail}).
 * `fellows` are deputies of the same fleet, {letter, flight}, whose paths are drawn thin.
 * It may have pointsAt(k) where the chief turns (and atStart(k, vector), see onChief), isLit(k, point) where light is more than facing the Sun (or
 * tellsLight false where which points are lit is not told), and isSphere false where the chief is none, and before, the positions of another flight from the same start.
 * `touch(kind, direction)`, where given, hears of a start or a Sun that is dragged. A view that follows another, its
 * `lead`, has no time of its own: whoever holds both shows it what the lead shows.
 */
export class FlightView {
  constructor(element, flight, { touch = null, onTime = () => {}, onSample = () => {}, lead = null } = {}) {
    this.part = name => element.querySelector(`.${name}`);
    this.canvas = element.querySelector("canvas");
    this.pen = this.canvas.getContext("2d");
    this.flight = flight;
    this.touch = touch;
    this.clock = lead ?? this;
    this.onTime = onTime;
    this.onSample = onSample;
    this.sample = 0;
    this.angles = { yaw: -0.42, pitch: 0.3 };
    this.zoom = 1;
    this.others = [];
    this.fellows = [];
    this.said = "";
    this.part("time").max = flight.numSamples - 1;
    this.listen();
  }

  /** Show another flight, at the same time and from the same angle. */
  replace(flight) {
    this.flight = flight;
    this.part("time").max = flight.numSamples - 1;
    this.sample = Math.min(this.sample, flight.numSamples - 1);
    this.renew();
  }

  /** Draw a flight that was flown anew. */
  renew() {
    this.farthest = null;
    this.said = "";
    this.draw();
  }

  // --- time ---

  show(sample) {
    const chosen = Math.max(0, Math.min(this.flight.numSamples - 1, Math.round(sample)));
    if (chosen === this.sample && this.isPainted) return;
    this.sample = chosen;
    this.draw();
  }

  play() {
    if (this.sample >= this.flight.numSamples - 1) this.sample = 0;
    const first = this.sample, began = performance.now();
    this.isPlaying = true;
    this.part("play").textContent = "Pause";
    const tick = now => {
      if (!this.isPlaying) return;
      this.show(first + Math.floor((now - began) / 1000 * SPEED));
      if (this.sample >= this.flight.numSamples - 1) this.pause();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    this.isPlaying = false;
    this.part("play").textContent = "Play";
    this.onTime(this.sample);
  }

  // --- input ---

  listen() {
    const { canvas } = this;
    this.part("play").addEventListener("click", () => (this.isPlaying ? this.pause() : this.play()));
    this.part("time").addEventListener("input", event => {
      this.isPlaying = false;
      this.part("play").textContent = "Play";
      this.show(+event.target.value);
      this.onTime(this.sample);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    document.getElementById("theme")?.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
    let held = null;
    const where = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    const isNear = (a, b, reach) => b && Math.hypot(a[0] - b[0], a[1] - b[1]) < reach;
    canvas.addEventListener("pointerdown", event => {
      const at = where(event), reach = event.pointerType === "touch" ? 30 : 18;
      held = { at, kind: "view" };
      if (this.touch && isNear(at, this.startAt, reach)) held.kind = "start";
      else if (this.touch && isNear(at, this.sunAt, reach)) held.kind = "sun";
      canvas.setPointerCapture(event.pointerId);
      if (held.kind !== "view") event.preventDefault();
    });
    canvas.addEventListener("pointermove", event => {
      const at = where(event);
      if (!held) {
        const isHandle = this.touch && (isNear(at, this.startAt, 18) || isNear(at, this.sunAt, 18));
        canvas.style.cursor = isHandle ? "pointer" : "grab";
        return;
      }
      if (held.kind === "view") {
        this.angles.yaw -= (at[0] - held.at[0]) * 0.008;
        this.angles.pitch = Math.max(-1.5, Math.min(1.5, this.angles.pitch + (at[1] - held.at[1]) * 0.008));
        held.at = at;
        this.draw();
      } else {
        this.isPlaying = false;
        this.part("play").textContent = "Play";
        this.touch(held.kind, [at[0] - this.middle[0], this.middle[1] - at[1]].map(x => x / this.scale), this.basis);
      }
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
    canvas.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY / 500));
    }, { passive: false });
    canvas.addEventListener("keydown", event => {
      if (event.ctrlKey || event.altKey || event.metaKey) return; // the browser's own
      const turn = { ArrowLeft: ["yaw", 0.09], ArrowRight: ["yaw", -0.09], ArrowUp: ["pitch", 0.09], ArrowDown: ["pitch", -0.09] }[event.key];
      if (turn) this.angles[turn[0]] += turn[1];
      else if (event.key === "+" || event.key === "-") this.zoomBy(event.key === "+" ? 1.1 : 1 / 1.1);
      else if (event.key === " ") this.clock.isPlaying ? this.clock.pause() : this.clock.play();
      else return;
      event.preventDefault();
      this.draw();
    });
  }

  zoomBy(factor) {
    this.zoom = Math.max(0.4, Math.min(5, this.zoom * factor));
    this.draw();
  }

  // --- the picture ---

  /** Read the colours as the scheme has them now. */
  readColours() {
    const { canvas } = this;
    this.colour = Object.fromEntries(COLOURS.map(name => {
      canvas.style.color = `var(--${name})`;
      return [name, getComputedStyle(canvas).color];
    }));
  }

  draw() {
    if (this.isQueued) return;
    this.isQueued = true;
    requestAnimationFrame(() => { this.isQueued = false; this.paint(); });
  }

  /** Look from an angle about Hill's axes: to the eye, to the right and up on the picture, with radial up upwards. */
  look() {
    const { yaw, pitch } = this.angles;
    const eye = [Math.sin(pitch), Math.cos(pitch) * Math.sin(yaw), Math.cos(pitch) * Math.cos(yaw)];
    const right = unit(cross([1, 0, 0], eye));
    return { eye, right, up: cross(eye, right) };
  }

  on(point) {
    const depth = dot(point, this.basis.eye), nearer = this.eyeM / (this.eyeM - depth);
    return [this.middle[0] + this.scale * nearer * dot(point, this.basis.right),
      this.middle[1] - this.scale * nearer * dot(point, this.basis.up), depth];
  }

  /** Whether nothing between two points is in the picture: free motion leads kilometres away, where dashes take long, and behind the eye. */
  isOutside(a, b) {
    const [width, height] = this.size;
    return Math.max(a[2], b[2]) > NEAREST * this.eyeM || Math.max(a[0], b[0]) < 0 || Math.min(a[0], b[0]) > width || Math.max(a[1], b[1]) < 0 || Math.min(a[1], b[1]) > height;
  }

  line(points, colour, width, dash = []) {
    const { pen } = this;
    pen.beginPath();
    let before = null, isJoined = false;
    for (const point of points) {
      const now = this.on(point), isDrawn = before && !this.isOutside(before, now);
      if (isDrawn && !isJoined) pen.moveTo(before[0], before[1]);
      if (isDrawn) pen.lineTo(now[0], now[1]);
      [before, isJoined] = [now, isDrawn];
    }
    pen.strokeStyle = colour; pen.lineWidth = width; pen.lineJoin = "round";
    pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
  }

  ring(centre, radius, colour, dash = []) {
    const { pen } = this;
    pen.beginPath(); pen.arc(centre[0], centre[1], radius, 0, TURN);
    pen.strokeStyle = colour; pen.lineWidth = 1; pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
  }

  arrow([x, y], [a, b], colour, width, word = "") {
    const { pen } = this, angle = Math.atan2(b - y, a - x);
    pen.strokeStyle = pen.fillStyle = colour; pen.lineWidth = width; pen.lineCap = "round";
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(a, b); pen.stroke();
    pen.beginPath(); pen.moveTo(a + 8 * Math.cos(angle), b + 8 * Math.sin(angle));
    for (const side of [2.5, -2.5]) pen.lineTo(a + 7 * Math.cos(angle + side), b + 7 * Math.sin(angle + side));
    pen.fill();
    if (word) this.word(word, a, b - 10, colour, "600 ");
  }

  word(text, x, y, colour, weight = "") {
    const { pen } = this;
    pen.font = `${weight}13px system-ui, sans-serif`;
    const isRight = x > this.size[0] - pen.measureText(text).width - 14;
    pen.textAlign = isRight ? "right" : "left";
    pen.lineWidth = 4; pen.lineJoin = "round"; pen.strokeStyle = this.colour.paper;
    pen.strokeText(text, x + (isRight ? -10 : 10), y); pen.fillStyle = colour; pen.fillText(text, x + (isRight ? -10 : 10), y);
  }

  paint() {
    this.readColours();
    const { canvas, pen, flight, colour } = this, ratio = devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    this.isPainted = true;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.size = [width, height];
    this.basis = this.look();
    this.eyeM = Math.max(EYE_M, 2.6 * this.reach());
    const isNarrow = width < 560;
    // the close-up of the chief takes a corner
    this.middle = isNarrow ? [width / 2, height * 0.36] : [width * 0.4, height * 0.5];
    this.scale = this.zoom * Math.min(isNarrow ? width : width * 0.8, height * (isNarrow ? 0.72 : 1)) / (2.2 * this.reach());
    const k = this.sample, sun = flight.sun(k);
    pen.globalAlpha = 0.16;
    for (const { path, isOutside } of this.others) this.line(path, isOutside ? colour.push : colour.ink, 1);
    pen.globalAlpha = 1;
    const centre = this.on([0, 0, 0]);
    flight.limits.forEach(limit => {
      this.ring(centre, this.scale * limit, colour.muted, [2, 4]);
      const reach = 0.71 * this.scale * limit;
      if (reach > 60 && centre[0] + reach < width) this.word(`${limit} m`, centre[0] + reach, centre[1] + reach, colour.muted);
    });
    const path = Array.from({ length: flight.numSamples }, (_, sample) => flight.position(sample));
    this.line(path, colour.grid, 2);
    if (flight.before) this.line(flight.before, colour.muted, 2, [7, 5]);
    const coast = flight.coast(k);
    if (coast) this.line(coast, colour.muted, 1.5, [5, 5]);
    this.half(path, k, true);
    this.sphere(centre, this.scale * flight.radius, sun, this.basis, k);
    this.half(path, k, false);
    this.sunAt = sun && this.on(scaled(sun, flight.radius + 0.45 * this.reach()));
    if (sun) this.arrow(this.on(scaled(sun, 1.4 * flight.radius)), this.sunAt, colour.lit, 3, "Sun");
    this.startAt = this.on(path[0]);
    pen.beginPath(); pen.arc(this.startAt[0], this.startAt[1], 7, 0, TURN); pen.strokeStyle = colour.ink; pen.lineWidth = 2; pen.stroke();
    const here = path[k], force = flight.force(k), size = norm(force);
    const at = this.on(here), [startX, startY] = this.startAt;
    if (!size || Math.hypot(at[0] - startX, at[1] - startY) > 60) this.word("start", startX, startY + 4, colour.ink); // else arrows are there
    const words = [], taken = sun ? [[this.sunAt[0], this.sunAt[1] - 10]] : [];
    force.forEach((part, axis) => {
      if (!part) return;
      const end = here.slice(); end[axis] += Math.sign(part) * (26 + Math.min(130, 450 * Math.abs(part))) / this.scale;
      const to = this.on(end);
      this.arrow(at, to, colour.push, 3.5);
      words.push([AXES[axis][+(part > 0)], to[0], to[1] - 10]);
    });
    this.fellows.forEach(fellow => this.fellow(fellow, k * flight.periodS));
    pen.fillStyle = colour.ink; pen.beginPath(); pen.arc(at[0], at[1], 6, 0, TURN); pen.fill();
    // before the deputy, and apart from each other and from the Sun's, from the top down
    words.sort((a, b) => a[2] - b[2]).forEach(([word, x, y]) => {
      for (const [otherX, otherY] of taken) if (Math.abs(otherX - x) < 50 && Math.abs(otherY - y) < 15) y = otherY + 15;
      taken.push([x, y]);
      this.word(word, x, y, colour.push, "600 ");
    });
    if (k !== this.heard) this.onSample(k); // what others draw, once a painted sample
    this.heard = k;
    this.triad(isNarrow);
    if (flight.points.length) this.closeUp(k, sun, here, isNarrow);
    this.say(k);
  }

  /** Draw where another deputy of the same fleet has flown until a time, s. */
  fellow({ letter, flight }, seconds) {
    const { pen, colour } = this, last = Math.min(flight.numSamples - 1, Math.round(seconds / flight.periodS));
    this.line(Array.from({ length: last + 1 }, (_, k) => flight.position(k)), colour.muted, 1.5);
    const [x, y] = this.on(flight.position(last));
    pen.fillStyle = colour.muted; pen.beginPath(); pen.arc(x, y, 5, 0, TURN); pen.fill();
    this.word(letter, x, y + 4, colour.muted, "600 ");
  }

  /** Return the distance that the picture must hold, m: not much beyond the outer limit, and some radii. */
  reach() {
    if (!this.farthest) {
      const { flight } = this, [, outer = Infinity] = flight.limits;
      const positions = Array.from({ length: flight.numSamples }, (_, k) => flight.position(k));
      const distances = [...positions, ...(flight.before ?? [])].map(norm);
      this.farthest = Math.min(1.3 * outer, Math.max(7 * flight.radius, ...distances));
    }
    return this.farthest;
  }

  /** Draw what was flown behind the chief, or before it. */
  half(path, last, isBehind) {
    let run = [];
    for (let index = 0; index <= last; index++) {
      const isHere = dot(path[index], this.basis.eye) < 0;
      if (isHere === isBehind) { run.push(path[index]); continue; }
      if (run.length) this.line([...run, path[index]], this.colour.ink, 3);
      run = [];
    }
    if (run.length > 1) this.line(run, this.colour.ink, 3);
  }

  /** Draw the chief: its lit half, and its points that face the eye. */
  sphere(centre, radius, sun, { eye, right, up }, k) {
    const { pen, flight, colour } = this;
    const towards = sun ? [dot(sun, right), -dot(sun, up)] : [0, 0], facing = sun ? dot(sun, eye) : 1;
    const isLitNow = flight.isLit ?? ((_, index) => flight.tellsLight !== false && facesSun(points[index], sun));
    const points = flight.pointsAt?.(k) ?? flight.points, hasBody = flight.isSphere !== false;
    const gradient = pen.createLinearGradient(centre[0] - towards[0] * radius, centre[1] - towards[1] * radius,
      centre[0] + towards[0] * radius + 1e-6, centre[1] + towards[1] * radius);
    const edge = 0.5 - 0.5 * Math.max(-0.9, Math.min(0.9, facing));
    gradient.addColorStop(Math.max(0, edge - 0.08), colour.shade);
    gradient.addColorStop(Math.min(1, edge + 0.08), colour.body);
    if (hasBody) { pen.fillStyle = gradient; pen.beginPath(); pen.arc(centre[0], centre[1], radius, 0, TURN); pen.fill(); }
    const share = radius / flight.radius;
    points.forEach((point, index) => {
      const depth = dot(point, eye);
      if (depth < 0.05 * flight.radius && hasBody) return;
      const x = centre[0] + share * dot(point, right), y = centre[1] - share * dot(point, up);
      pen.beginPath(); pen.arc(x, y, Math.max(1.5, radius * (0.035 + 0.035 * Math.max(0, depth) / flight.radius)), 0, TURN);
      if (flight.isSeen(k, index)) { pen.fillStyle = colour.seen; pen.fill(); }
      else if (isLitNow(k, index)) { pen.strokeStyle = colour.lit; pen.lineWidth = Math.max(1.2, radius * 0.02); pen.stroke(); }
      else { // smaller, for those who tell colours badly
        pen.beginPath(); pen.arc(x, y, Math.max(1, radius * (0.015 + 0.015 * Math.max(0, depth) / flight.radius)), 0, TURN);
        pen.fillStyle = colour.dark; pen.fill();
      }
    });
  }

  /** Draw the chief as the deputy's camera has it before it, with up as it is in the scene. */
  closeUp(k, sun, here, isNarrow) {
    const { pen, colour } = this, [width, height] = this.size;
    const radius = isNarrow ? Math.min(width * 0.27, height * 0.17) : Math.min(width * 0.145, height * 0.3);
    const centre = isNarrow ? [width - radius - 16, height - radius - 30] : [width - radius - 22, height * 0.52];
    const eye = unit(here), flat = cross([1, 0, 0], eye);
    const right = norm(flat) > 1e-9 ? unit(flat) : [0, 0, 1];
    this.sphere(centre, radius, sun, { eye, right, up: cross(eye, right) }, k);
    this.ring(centre, radius + 7, colour.grid);
    pen.font = "13px system-ui, sans-serif"; pen.textAlign = "center"; pen.fillStyle = colour.muted;
    pen.fillText("seen from the deputy", Math.min(centre[0], width - 70), centre[1] + radius + 24);
  }

  /** Draw Hill's axes in a corner. */
  triad(isNarrow) {
    const [, height] = this.size, corner = [78, height - (isNarrow ? 62 : 66)], { pen, colour } = this;
    [["up", [1, 0, 0]], ["ahead", [0, 1, 0]], ["north", [0, 0, 1]]].forEach(([word, axis]) => {
      const x = dot(axis, this.basis.right), y = -dot(axis, this.basis.up), long = Math.hypot(x, y);
      if (long < 0.15) return;
      this.arrow(corner, [corner[0] + 30 * x, corner[1] + 30 * y], colour.muted, 1.3);
      pen.font = "12px system-ui, sans-serif"; pen.textAlign = "center"; pen.fillStyle = colour.muted;
      pen.fillText(word, corner[0] + (30 * long + 20) * x / long, corner[1] + (30 * long + 16) * y / long + 4);
    });
  }

  /** Tell the time, what is inspected, and why the deputy does what it does. */
  say(k) {
    const { flight } = this, minutes = Math.floor(k * flight.periodS / 60);
    const seen = flight.points.filter((_, index) => flight.isSeen(k, index)).length;
    const total = flight.points.length ? `${seen} of ${flight.points.length} points` : "", spent = flight.spent(k);
    this.part("count").textContent = [`${minutes} min`, total, Number.isFinite(spent) ? `${spent.toFixed(2)} m/s` : ""].filter(Boolean).join(" · ");
    this.part("time").value = k;
    this.part("time").setAttribute("aria-valuetext", total ? `${minutes} minutes, ${total} inspected` : `${minutes} minutes`);
    const reasons = flight.reasons(k), text = reasons.map(({ text: fact, detail }) => `${fact} ${detail}`).join("\n");
    if (text === this.said) return;
    this.said = text;
    this.part("why").replaceChildren(...reasons.map(({ text: fact, detail }) => {
      const row = document.createElement("p"), strong = document.createElement("b");
      strong.textContent = fact;
      row.append(strong, ` ${detail}`);
      return row;
    }));
  }
}

/** What is said where a flight ends, of which `path` is that of free motion, or null where none is drawn. */
export const endedBefore = path => [{ text: "The flight ends here.", detail: `Nothing is decided any more${path ? "; the dashed path is free motion" : ""}.` }];

/** Return whether a point of a sphere faces the Sun. */
export function facesSun(point, sun) {
  return dot(point, sun) > 0;
}

/** Return the name of a push along an axis, such as "Push ahead, 28 mN." */
export function pushText(axis, force) {
  const millinewtons = 1000 * Math.abs(force);
  return `Push ${AXES[axis][+(force > 0)]}, ${millinewtons < 1 ? +millinewtons.toPrecision(1) : millinewtons.toFixed(0)} mN.`;
}

/** A time of a flight, such as "20 min 30 s". */
export function clockWords(seconds) {
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
}

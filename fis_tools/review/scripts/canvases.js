// Canvases: sharp, and drawn again when what they show, the theme, the width or the medium changes.

const drawings = [];
const inSight = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      const drawing = drawings.find(({ canvas }) => canvas === target);
      drawing.isSeen = isIntersecting;
      drawing.ask();
    }
  },
  { rootMargin: "300px" },
);

/** Keep a canvas drawn while it is in sight; return what asks for a new drawing. */
function keepDrawn(canvas, work) {
  const drawing = { canvas, work, isSeen: false, isStale: true };
  drawing.ask = oncePerFrame(() => {
    if (!drawing.isSeen || !drawing.isStale) return;
    drawing.isStale = false;
    work();
  });
  drawings.push(drawing);
  inSight.observe(canvas);
  return () => {
    drawing.isStale = true;
    drawing.ask();
  };
}

/** Draw all canvases again: those in sight soon, the others when they come into sight. */
function redrawAll() {
  for (const drawing of drawings) {
    drawing.isStale = true;
    drawing.ask();
  }
}

/** Draw all canvases at once, seen or not, for what cannot wait. */
function redrawNow() {
  for (const { work } of drawings) work();
}

/** Make a canvas sharp on this screen; return its context in units of the page, and its size. */
function sharpContext(canvas) {
  const width = Math.max(canvas.clientWidth, 1);
  const height = Math.max(canvas.clientHeight, 1);
  const ratio = Math.max(window.devicePixelRatio || 1, 2);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = `11px ${getComputedStyle(document.body).fontFamily}`;
  return { context, width, height };
}

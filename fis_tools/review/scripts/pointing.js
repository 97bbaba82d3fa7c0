// Pointing at drawings: what lies under the pointer, told beside it; and zooming by pinch, wheel, keys and buttons.

const LEAST_WINDOW = 0.01;

/** Tell beside the pointer what `describe` says of a place on an element; nothing where it returns null. */
function tellUnder(element, describe, left = () => {}) {
  const hide = () => {
    tip.hidden = true;
    left();
  };
  element.addEventListener("pointermove", (event) => {
    const words = describe(event);
    tip.hidden = words === null;
    if (words === null) return;
    tip.textContent = words;
    const room = document.documentElement.clientWidth - tip.offsetWidth - 8;
    tip.style.left = `${Math.max(Math.min(event.clientX + 14, room), 4)}px`;
    tip.style.top = `${event.clientY + 18}px`;
  });
  element.addEventListener("pointerleave", hide);
  element.addEventListener("pointercancel", hide);
}

const tip = make("div", { class: "tip", hidden: true, "aria-hidden": "true" });
document.body.append(tip);

/** The part of a whole that a drawing shows along one axis, in fractions of it. */
class Part {
  constructor() {
    this.low = 0;
    this.high = 1;
  }

  /** The window on a range of values. */
  of(low, high) {
    return [low + this.low * (high - low), low + this.high * (high - low)];
  }

  /** Show more or less around a place, a fraction of what is shown. */
  zoom(factor, place) {
    const width = Math.min(Math.max((this.high - this.low) * factor, LEAST_WINDOW), 1);
    const centre = this.low + place * (this.high - this.low);
    this.low = Math.min(Math.max(centre - place * width, 0), 1 - width);
    this.high = this.low + width;
  }
}

/**
 * Let a canvas zoom into its parts; `placeOf` maps an event to a place in fractions of what is shown, an axis each.
 * Returns the buttons that do the same.
 */
function makeZoomable(canvas, parts, placeOf, changed, about) {
  const zoom = (factor, places = parts.map(() => 0.5)) => {
    parts.forEach((part, axis) => part.zoom(factor, Math.min(Math.max(places[axis], 0), 1)));
    changed();
  };
  const ways = { "+": 0.5, "=": 0.5, "-": 2, "−": 2, 0: 1 / LEAST_WINDOW };
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, placeOf(event));
  });
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in ways) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    zoom(ways[event.key]);
  });
  const button = (sign, words) =>
    make("button", { type: "button", "aria-label": `${words} of ${about}`, click: () => zoom(ways[sign]) }, words);
  const buttons = [button("+", "zoom in"), button("-", "zoom out"), button(0, "show all")];
  return make("div", { class: "zoom", role: "group", "aria-label": `Zoom of ${about}` }, ...buttons);
}

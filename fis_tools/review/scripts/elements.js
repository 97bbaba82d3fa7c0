// Elements of the page: made, filled and found. Texts go in as text, never as markup.

const SVG = "http://www.w3.org/2000/svg";

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

/** Make an HTML element; functions among the attributes listen to the event of that name. */
function make(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** Make an element of a drawing. */
function draw(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

/** Run `work` once before the next picture, however often it is asked for until then. */
function oncePerFrame(work) {
  let isAsked = false;
  return () => {
    if (isAsked) return;
    isAsked = true;
    requestAnimationFrame(() => {
      isAsked = false;
      work();
    });
  };
}

/** Run `work` once it has not been asked for during a moment. */
function onceIdle(work, milliseconds = 150) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(work, milliseconds);
  };
}

/** A select element with its label; `changed` is told the index of the choice. */
function choice(label, names, chosen, changed) {
  const options = names.map((name, index) => make("option", { value: index }, name));
  const select = make("select", { change: () => changed(Number(select.value)) }, ...options);
  select.value = String(chosen);
  return { select, element: make("label", { class: "choice" }, make("span", {}, label), select) };
}

// The control surface of a system: which inputs lie along the axes, where the others are held, and both pictures.

/** Fill an element with the surface of a system over any two of its inputs. */
function surfaceView(element, state, scale, id) {
  const { system } = state;
  const shownAs = { x: 0, y: 1, output: 0 };
  const view = { ...FIRST_VIEW };
  const about = `Surface of ${system.name} in perspective; the arrow keys turn it, Home turns it back`;
  const solid = make("canvas", { class: "solid", tabindex: "0", role: "img", "aria-label": about });
  const words = `Heat map of ${system.name} with contours; + and − zoom, 0 shows all`;
  const map = make("canvas", { class: "map", tabindex: "0", role: "img", "aria-label": words });
  const parts = [new Part(), new Part()];
  let pointed = null;
  const range = make("p", { class: "note" });
  let response = null;
  let shape = "";

  /** Evaluate the surface where its axes or held inputs are others than before. */
  const evaluated = () => {
    const { x, y, output } = shownAs;
    const others = state.inputs.filter((_, i) => i !== x && i !== y);
    const wanted = [x, y, output, ...others, ...parts.flatMap(({ low, high }) => [low, high])].join();
    if (wanted !== shape) {
      shape = wanted;
      response = responseOver(state, x, y, output, parts);
      range.textContent = rangeWords(response, heldWords(state, x, y));
    }
    return response;
  };
  const point = () => [state.inference.clipped[shownAs.x], state.inference.clipped[shownAs.y]];
  const value = () => state.inference.outputs[shownAs.output].value;
  const paintMap = keepDrawn(map, () => paintHeatMap(map, evaluated(), scale, point()));
  const turned = keepDrawn(solid, () => {
    const points = [[...point(), value()], ...(pointed ? [pointed] : [])];
    paintSolid(solid, evaluated(), scale, view, points);
  });
  const update = () => {
    paintMap();
    turned();
  };
  const controls = system.inputs.map((_, place) => inputControl(state, place, `${id}-held${place + 1}`));
  const holdOthers = () => {
    controls.forEach((control, place) => (control.hidden = place === shownAs.x || place === shownAs.y));
    held.hidden = system.inputs.length < 3;
  };
  const held = make("div", { class: "held" }, make("p", { class: "note" }, "Held:"), ...controls);
  const axes = axisChoices(system, shownAs, () => {
    holdOthers();
    update();
  });
  makeTurnable(solid, view, turned);
  /** The inputs under a pointer on the map, the others as they are. */
  const inputsAt = (event) => {
    const at = pointOnMap(map, evaluated(), event);
    return at && state.inputs.with(shownAs.x, at[0]).with(shownAs.y, at[1]);
  };
  const pointAt = (inputs) => {
    pointed = inputs && [inputs[shownAs.x], inputs[shownAs.y], evaluate(system, inputs, shownAs.output)];
    turned();
    return pointed;
  };
  const describe = (event) => {
    const inputs = inputsAt(event);
    if (inputs && event.buttons === 1) state.setInputs(inputs);
    const found = pointAt(inputs);
    if (!found) return null;
    const variables = [system.inputs[shownAs.x], system.inputs[shownAs.y], system.outputs[shownAs.output]];
    return variables.map((variable, i) => `${variable.name} = ${quantity(found[i], variable, 3)}`).join(", ");
  };
  tellUnder(map, describe, () => pointAt(null));
  map.addEventListener("pointerdown", (event) => {
    const inputs = inputsAt(event);
    if (inputs) state.setInputs(inputs);
  });
  const zooming = makeZoomable(map, parts, (event) => placeOnMap(map, event), update, `the surface of ${system.name}`);
  const pictures = make("div", { class: "surfaces" }, solid, map);
  element.append(make("div", { class: "controls" }, ...axes, zooming, held), pictures, range);
  holdOthers();
  state.follow(update);
}

/** Say at what values the inputs that are no axis are held. */
function heldWords({ system, inputs }, x, y) {
  const others = system.inputs.filter((_, i) => i !== x && i !== y);
  const valueOf = (variable) => quantity(inputs[system.inputs.indexOf(variable)], variable);
  const words = others.map((variable) => `${variable.name} = ${valueOf(variable)}`);
  return words.length ? `, with ${words.join(", ")},` : "";
}

function rangeWords({ variable, low, high }, held) {
  const extent = `${quantity(low, variable)} to ${quantity(high, variable)}`;
  const zero = low < 0 && high > 0 ? ", the thick line is zero" : "";
  return `On this surface${held} ${variable.name} goes from ${extent}; the ring marks the present inputs${zero}.`;
}

/** The choices of both axes and of the output, those with nothing to choose left out. */
function axisChoices(system, shownAs, changed) {
  const names = system.inputs.map(withUnit);
  const axis = (own, other) =>
    choice(`Along ${own}`, names, shownAs[own], (chosen) => {
      if (chosen === shownAs[other]) {
        shownAs[other] = shownAs[own];
        choosers[other].select.value = String(shownAs[other]);
      }
      shownAs[own] = chosen;
      changed();
    });
  const choosers = { x: axis("x", "y"), y: axis("y", "x") };
  const shownChoosers = [choosers.x, choosers.y];
  if (system.outputs.length > 1) {
    const outputs = system.outputs.map(withUnit);
    const choose = (chosen) => {
      shownAs.output = chosen;
      changed();
    };
    shownChoosers.push(choice("Output", outputs, 0, choose));
  }
  return shownChoosers.map(({ element }) => element);
}

/** Fill an element with the response of a system of one input: a curve for each output. */
function curveView(element, state) {
  const { system } = state;
  const [variable] = system.inputs;
  system.outputs.forEach((shownOutput, output) => {
    const part = new Part();
    const about = `${shownOutput.name} over ${variable.name}`;
    const canvas = make("canvas", { class: "response", tabindex: "0", role: "img", "aria-label": about });
    const paint = keepDrawn(canvas, () => paintCurve(canvas, partOf(variable, part), shownOutput, state, output));
    const place = ({ offsetX }) => (offsetX - CURVE.left) / (canvas.clientWidth - CURVE.left - CURVE.right);
    const inputAt = (event) => {
      const [low, high] = part.of(variable.minimum, variable.maximum);
      return low + Math.min(Math.max(place(event), 0), 1) * (high - low);
    };
    tellUnder(canvas, (event) => {
      const x = inputAt(event);
      if (event.buttons === 1) state.setInputs([x]);
      const y = evaluate(system, [x], output);
      return `${variable.name} = ${quantity(x, variable, 3)}, ${shownOutput.name} = ${quantity(y, shownOutput, 3)}`;
    });
    canvas.addEventListener("pointerdown", (event) => state.setInputs([inputAt(event)]));
    const zooming = makeZoomable(canvas, [part], (event) => [place(event)], paint, about);
    element.append(make("div", { class: "controls" }, zooming), canvas);
    state.follow(paint);
  });
}

const CURVE = { left: 58, right: 12 };

function paintCurve(canvas, variable, output, state, place) {
  const xs = spaced(variable.minimum, variable.maximum, 201);
  const ys = xs.map((x) => evaluate(state.system, [x], place));
  const { context, width, height } = sharpContext(canvas);
  const colours = themeColours();
  const [low, high] = extremes(ys);
  const margin = (high - low || Math.abs(high) || 1) * 0.06;
  const along = { ...output, minimum: low - margin, maximum: high + margin };
  const frame = { left: CURVE.left, top: 10, width: width - CURVE.left - CURVE.right, height: height - 54 };
  const { x, y } = paintMapAxes(context, { xVariable: variable, yVariable: along }, frame, colours);
  context.strokeStyle = colours.accent;
  context.lineWidth = 2;
  polygon(context, xs.map((value, i) => [x(value), y(ys[i])]));
  context.stroke();
  paintMark(context, x(state.inference.clipped[0]), y(state.inference.outputs[place].value), colours);
}

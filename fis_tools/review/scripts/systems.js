// Systems as a page carries them, decoded once.

/** Decode the base64 of little-endian doubles. */
function decodeDoubles(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Float64Array(bytes.buffer);
}

/** The points of a variable's universe: carried, or so many at even distances, as NumPy's linspace rounds them. */
function decodeUniverse({ universe, minimum, maximum }) {
  if (typeof universe === "string") return decodeDoubles(universe);
  const step = (maximum - minimum) / (universe - 1);
  return Float64Array.from({ length: universe }, (_, i) => (i < universe - 1 ? i * step + minimum : maximum));
}

function decodeVariable(variable) {
  const decode = (thing, keys) =>
    Object.fromEntries(keys.filter((key) => key in thing).map((key) => [key, decodeDoubles(thing[key])]));
  const terms = variable.terms.map((term) => ({
    ...term,
    ...decode(term, ["values", "sampled", "numbers", "points", "heights"]),
  }));
  return { ...variable, universe: decodeUniverse(variable), ...decode(variable, ["points"]), terms };
}

function decodeSystem(system) {
  return {
    ...system,
    inputs: system.inputs.map(decodeVariable),
    outputs: system.outputs.map(decodeVariable),
  };
}

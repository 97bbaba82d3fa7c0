// A compiled module with a snapshot in its memory, see pipeline/player/snapshot.py.

const LINE = 64, PAGE = 65536;
const rounded = (value, step) => Math.ceil(value / step) * step;

/** What numba's code asks of C before it gives an array another shape: its new strides, 1 if it need not be copied. */
function reshaped(memory, [count, shape, strides, newCount, newShape, newStrides, size]) {
  const numbers = (address, length) => new BigInt64Array(memory.buffer, Number(address), Number(length));
  const before = numbers(shape, count), held = numbers(strides, count), wanted = numbers(newShape, newCount), given = numbers(newStrides, newCount);
  let step = BigInt(size);
  for (let axis = before.length - 1; axis >= 0; axis--) {
    if (before[axis] !== 1n && held[axis] !== step) return 0;
    step *= before[axis];
  }
  step = BigInt(size);
  for (let axis = wanted.length - 1; axis >= 0; axis--) {
    given[axis] = step;
    step *= wanted[axis];
  }
  return 1;
}

/**
 * Start a module, and put a snapshot into its memory.
 *
 * `view(name, Kind, offset)` is an array that is shared, `set(name, value)` sets a slot of all functions that have it,
 * and `call(name)` runs a function. A snapshot of other types than the module's is refused.
 */
export async function openModule(bytes, snapshot) {
  const compiled = await WebAssembly.compile(bytes);
  const env = Object.fromEntries(WebAssembly.Module.imports(compiled).map(({ name }) => [name, Math[name] ?? (() => {
    throw new Error(`the module calls ${name}, which no flight of its types does`);
  })]));
  if (env.fmod) env.fmod = (a, b) => a % b;
  if (env.numba_attempt_nocopy_reshape) env.numba_attempt_nocopy_reshape = (...given) => reshaped(code.memory, given);
  const code = (await WebAssembly.instantiate(compiled, { env })).exports;
  const content = new Uint8Array(await inflated(snapshot.content));
  const base = rounded(code.memory.buffer.byteLength, LINE), zeros = base + rounded(content.byteLength, LINE);
  code.memory.grow(Math.ceil((zeros + snapshot.numZeros + LINE - code.memory.buffer.byteLength) / PAGE));
  const { buffer } = code.memory;
  new Uint8Array(buffer).set(content, base);
  const slots = {};
  for (const [name, { types, slots: text, content: inContent, zeros: inZeros, chosen }] of Object.entries(snapshot.functions)) {
    if (code[`${name}_types`]?.() !== types) throw new Error(`the module's ${name} is of other types than its snapshot; build it anew: python -m pipeline.player.build`);
    const given = new Uint8Array(await inflated(text)), at = Number(code[`${name}_at`]());
    new Uint8Array(buffer).set(given, at);
    const words = new BigInt64Array(buffer, at, given.length / 8);
    inContent.forEach(index => { words[index] += BigInt(base); });
    inZeros.forEach(index => { words[index] += BigInt(zeros); });
    slots[name] = { words, chosen };
  }
  return {
    view(name, Kind = Float64Array, offset = 0) {
      const [isZero, start, size] = snapshot.arrays[name];
      return new Kind(buffer, (isZero ? zeros : base) + start + offset, (size - offset) / Kind.BYTES_PER_ELEMENT | 0);
    },
    set(name, value) {
      for (const { words, chosen } of Object.values(slots)) if (name in chosen) words[chosen[name]] = BigInt(value);
    },
    call(name) {
      const status = code[name]();
      if (status) throw new Error(`the compiled ${name} stopped with status ${status}`);
    },
  };
}

// The compiled flight: its memory as arrays, by the names that the product gives them.

const PIECE = 8, HEADER = 4; // of fis_tools/engines/packing.py
const LAYOUT = ["inputs", "terms0", "terms1", "terms2", "points0", "points1", "points2", "values0", "values1", "values2",
  "outputTerms", "outputPoints", "outputValues", "pieces", "ranks", "rules"];

/** Start the module; `table` is of docs/scripts/home.py. */
export async function openFlights(bytes, table) {
  const module = await openModule(bytes, table.snapshot), { view } = module;
  const log = name => view(`results.log.${name}`), marks = name => view(`results.log.${name}`, Uint8Array);
  const rows = view("flights.law.layout", BigInt64Array);
  const layouts = table.systems.map((_, index) =>
    Object.fromEntries(LAYOUT.map((name, column) => [name, Number(rows[index * LAYOUT.length + column])])));
  const values = view("flights.values"), rules = view("flights.rules", BigInt64Array);
  // what a flight does not decide it does not write, so that of the flight before would stay
  const logged = Object.keys(table.snapshot.arrays).filter(name => name.startsWith("results.log.")).map(name => view(name, Uint8Array));
  const lanes = view("work.scratch", Float64Array, table.inputs), sharesByTerm = view("shares");
  return {
    table, layouts, values, rules, view, order: [],
    starts: view("flights.cases"), outcomes: view("results.outcomes"), tracks: view("results.tracks", Float32Array),
    points: view("flights.world.points"), freeMotion: view("freeMotion"),
    log: {
      position: log("position_m"), velocity: log("velocity_m_s"), force: log("force_hill_n"), sun: log("sun_angle_rad"),
      asked: log("force_asked_n"), change: log("safety_force_hill_n"), inputs: log("fis_input"), spent: log("delta_v_m_s"),
      numCandidates: view("results.log.num_candidates", BigInt64Array), isInspected: marks("is_inspected"), isDecided: marks("is_decided"),
    },
    /** Fly flights first to last - 1; one alone may be logged, and all be tracked. */
    fly(first, last, { isLogged = false, isTracked = false } = {}) {
      if (isLogged) logged.forEach(array => array.fill(0));
      module.set("first", first);
      module.set("last", last);
      module.set("results.log.position_m:length0", isLogged ? table.num_controls + 1 : 0);
      module.set("results.tracks:length0", isTracked ? table.num_starts : 0);
      module.call("fly");
    },
    /** Return what each of the rules that are packed adds to an output, in its unit. */
    shares(index, inputs) {
      inputs.forEach((value, column) => { lanes[2 * column] = lanes[2 * column + 1] = value; });
      module.set("system", index);
      module.call("share");
      return this.order[index].map(position => sharesByTerm[position]);
    },
  };
}

const grid = ([low, high], count) =>
  Array.from({ length: count }, (_, index) => index === count - 1 ? high : index * ((high - low) / (count - 1)) + low);

function membership({ left, peak, right }, x) {
  if (x === peak) return 1;
  if (left < x && x < peak) return (x - left) / (peak - left);
  return peak < x && x < right ? (right - x) / (right - peak) : 0;
}

/** Write the tables of the systems, as fis_tools/engines/packing.py does. */
export function pack(flights, systems) {
  const { values, rules, layouts } = flights;
  systems.forEach((system, index) => {
    const layout = layouts[index];
    system.inputs.forEach((input, column) => {
      const start = layout[`values${column}`], count = layout[`points${column}`], [low, high] = input.range;
      const step = (high - low) / (count - 1), terms = input.terms;
      values.set([low, high, step, 1 / step], start);
      grid(input.range, count).forEach((x, point) => terms.forEach((term, at) => {
        values[start + HEADER + point * terms.length + at] = membership(term, x);
      }));
    });
    const { terms, range, default: nothing } = system.output, [low, high] = range;
    const count = layout.outputPoints, start = layout.outputValues, universe = grid(range, count);
    const sampled = terms.map(term => universe.map(x => membership(term, x)));
    sampled.forEach((row, term) => { rules[layout.rules + term] = BigInt(row.indexOf(Math.max(...row))); });
    for (let piece = 0; piece * PIECE < count; piece++) {
      const ends = sampled.map(row => {
        const part = row.slice(piece * PIECE, (piece + 1) * PIECE);
        return [Math.max(...part), Math.min(...part)];
      });
      ends.map((_, term) => term).sort((a, b) => ends[b][0] - ends[a][0] || a - b).forEach((term, rank) => {
        rules[layout.ranks + piece * terms.length + rank] = BigInt(term);
        values.set(ends[term], layout.pieces + (piece * terms.length + rank) * 2);
      });
    }
    values.set([0.5 * (low + high), (high - low) / (count - 1), nothing], start);
    sampled.forEach((row, term) => row.forEach((degree, point) => {
      values[start + HEADER + term * count + point] = degree;
      values[start + HEADER + terms.length * count + point * terms.length + term] = degree;
    }));
    packRules(flights, system, index);
  });
}

/** Write the rules of a system, those of one term together. */
function packRules({ rules, layouts, order }, system, index) {
  const layout = layouts[index], count = system.output.terms.length, start = layout.rules + count;
  for (let term = 0; term <= count; term++) rules[start + term] = BigInt(system.rules.filter(rule => rule.then < term).length);
  const firsts = system.inputs.map((_, column) =>
    system.inputs.slice(0, column).reduce((sum, input) => sum + input.terms.length, 0));
  const sorted = system.rules.map((rule, at) => ({ ...rule, at })).sort((a, b) => a.then - b.then || a.at - b.at);
  sorted.flatMap(rule => rule.if.map((term, column) => firsts[column] + term))
    .forEach((slot, at) => { rules[start + count + 1 + at] = BigInt(slot); });
  order[index] = system.rules.map((_, at) => sorted.findIndex(rule => rule.at === at));
}

// A case that a worker flew, as what the views show; see FlightView for what a flight has.

/** Begin a worker with the scripts that stand in a page; `ask` sends it something and promises its answer. */
function beginWorker(source) {
  const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
  const waiting = new Map();
  let count = 0;
  worker.onmessage = ({ data: { id, log, error } }) => {
    const { resolve, reject } = waiting.get(id);
    waiting.delete(id);
    if (error) reject(new Error(error));
    else resolve(log);
  };
  return message => new Promise((resolve, reject) => {
    count += 1;
    waiting.set(count, { resolve, reject });
    worker.postMessage({ ...message, id: count });
  });
}

const three = (array, k) => [array[3 * k], array[3 * k + 1], array[3 * k + 2]];
const floatsOf = text => new Float32Array(bytesOf(text).buffer);

/** Where free motion leads from a state over an orbit, by the matrices of a page. */
function coasted(rows, state) {
  return Array.from({ length: rows.length / 18 }, (_, at) => [0, 1, 2].map(axis =>
    state.reduce((sum, value, column) => sum + rows[18 * at + 6 * axis + column] * value, 0)));
}

/** A flight from the log that a worker returns. */
function flownFlight(shared, log) {
  const { numPoints, numSamples } = shared, last = numSamples - 1, width = log.inputs.length / last / Math.max(1, shared.numSystems);
  const flight = {
    ...shared,
    position: k => three(log.position, k),
    velocity: k => three(log.velocity, k),
    force: k => (k < last ? three(log.force, k) : [0, 0, 0]),
    asked: k => three(log.asked, k),
    change: k => three(log.change, k),
    isDecided: k => k < last && log.isDecided[k] > 0,
    isGiven: () => false,
    numSeen(k) {
      let count = 0;
      for (let j = 0; j < numPoints; j++) count += log.isSeen[k * numPoints + j];
      return count;
    },
    sun(k) {
      const level = Math.cos(log.elevation[k]);
      return [level * Math.cos(log.sun[k]), level * Math.sin(log.sun[k]), Math.sin(log.elevation[k])];
    },
    isSeen: (k, j) => log.isSeen[k * numPoints + j] > 0,
    spent: k => log.spent[k],
    inputs: (k, system, count) => log.inputs.subarray((k * shared.numSystems + system) * width).slice(0, count),
    coast: k => (shared.freeMotion.length ? coasted(shared.freeMotion, [...three(log.position, k), ...three(log.velocity, k)]) : null),
    reason: (k, axis) => reasonAt(flight, k, axis),
    reasons: k => told(flight, k, shared.words, (decided, axis) => shared.pushed(flight, decided, axis)),
  };
  return flight;
}

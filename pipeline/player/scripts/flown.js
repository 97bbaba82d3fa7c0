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
globalThis.beginWorker = beginWorker; // for whoever looks from the console, and the tests

/** What is said of a push where what is flown does not tell its reason. */
const UNTOLD = "Its reason stands in a recording of this flight.";

/**
 * A flight from the log that a worker returns; `reasons`, where given, are a table of those that the product logged,
 * and `last` is the sample at which the flight ends, where that is not the log's last.
 */
function flownFlight(shared, log, reasons, last = shared.numSamples - 1) {
  const { numPoints, tellsReasons } = shared, width = log.inputs.length / (shared.numSamples - 1) / Math.max(1, shared.numSystems);
  const untold = () => ({ texts: [UNTOLD], reasons: Array.from({ length: last }, () => [0, 0, 0]) });
  const table = reasons ?? (tellsReasons ? null : untold());
  const flight = {
    ...shared,
    numSamples: last + 1,
    numCounted: log.counted.subarray(0, numPoints).reduce((sum, counts) => sum + counts, 0),
    ...onChief(shared.points, shared.attitude),
    position: k => three(log.position, k),
    velocity: k => three(log.velocity, k),
    force: k => (k < last ? fired(three(log.force, k)) : [0, 0, 0]),
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
    coast: k => coasted(shared.freeMotion, [...three(log.position, k), ...three(log.velocity, k)]),
    reason: (k, axis) => reasonAt(flight, k, axis),
    why: k => (table ? whyOf(flight.reasons(k)) : shared.pushed(flight, k, pushedAxes(flight.force(k))[0])),
    reasons: k => (table ? (k < last ? reasonsOf(table, k, flight.force(k)) : endedBefore(flight.coast(k))) : told(flight, k, shared.words, (decided, axis) => shared.pushed(flight, decided, axis))),
  };
  return flight;
}

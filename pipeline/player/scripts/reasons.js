// What a flight does at a sample, and why: only what was decided there is said, or said with its time.

const SILENT_N = 1e-12, LEAST_CHANGE_N = 1e-9; // of pipeline/flight/fly/logged.py

/**
 * Why a component of the force was, or was not, fired at a sample before the end, as the product's logs call it.
 *
 * `flight` has stride, maxForce, coastsWhenComplete and numCounted, and of a sample asked(k), force(k), change(k) (by the
 * safety layer), isDecided(k), isGiven(k) and numSeen(k). For rules along Hill's axes and ideal thrusters.
 */
export function reasonAt(flight, k, axis) {
  const asked = flight.asked(k), size = Math.abs(asked[axis]), changed = flight.change(k)[axis];
  const wanted = Math.abs(flight.force(k)[axis] - changed);
  let reason = size < SILENT_N ? "silent" : wanted < 0.5 * Math.min(size, flight.maxForce) ? "dead_band" : "fired";
  const isDecision = k % flight.stride === 0, isIdle = isDecision && !flight.isDecided(k);
  if (isIdle) reason = "coasting";
  if (!isDecision) reason = "waiting";
  if (flight.coastsWhenComplete && flight.numSeen(k) === flight.numCounted) reason = "complete";
  if (isIdle && asked.some(part => part !== 0)) reason = "parked";
  if (flight.isGiven(k)) reason = "rehearsed";
  if (wanted > 0 && size > flight.maxForce + LEAST_CHANGE_N) reason = "clipped";
  return Math.abs(changed) > LEAST_CHANGE_N ? "safety" : reason;
}

const capital = text => text[0].toUpperCase() + text.slice(1);

/** The axes along which a force pushes, the strongest push first. */
export const pushedAxes = force => [0, 1, 2].filter(axis => force[axis]).sort((a, b) => Math.abs(force[b]) - Math.abs(force[a]));

/**
 * What the deputy does at a sample, as a list of {text, detail}; `pushed(k, axis)` says why a push came.
 *
 * `flight` also has numSamples, periodS, coast(k) and reason(k, axis); `words` are the product's for each reason.
 */
export function told(flight, k, words, pushed) {
  if (k >= flight.numSamples - 1) return endedBefore(flight.coast(k));
  // between two decisions a safety layer may push
  const decision = flight.force(k).some(Boolean) ? k : k - k % flight.stride, force = flight.force(decision), at = clockWords(decision * flight.periodS);
  const rows = pushedAxes(force).map(axis => ({ text: pushText(axis, force[axis]), detail: pushed(decision, axis), axis }));
  rows.forEach((row, place) => { if (row.detail === rows[place + 1]?.detail) row.detail = ""; });
  if (!rows.length) {
    const reason = [0, 1, 2].map(axis => flight.reason(decision, axis)).sort((a, b) => (a === "silent") - (b === "silent"))[0];
    rows.push({ text: "No push.", detail: `${capital(words[reason])}.` });
  }
  // between two decisions nothing is decided: what is told is of the last one, with its time
  return decision === k ? rows : rows.map((row, place) => place ? row : { ...row, text: `At ${at}: ${row.text[0].toLowerCase()}${row.text.slice(1)}` });
}

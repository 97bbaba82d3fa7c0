// A flight as the product flew it, from the arrays of a page, see pipeline/report/scene.py.
import { cross, endedBefore, plus, pushText, scaled } from "./view.js";

const ROUNDED_N = 1e-12; // what turning axes leaves of a force along one that has none

/** A force without what is but rounding. */
export const fired = force => force.map(part => (Math.abs(part) < ROUNDED_N ? 0 : part));

/** What was fired at a sample, and why, from a table's texts and the indices of those of each axis: a single one where nothing was. */
export function reasonsOf({ texts: all, reasons }, k, force) {
  const texts = reasons[k].map(index => all[index]);
  const rows = force.flatMap((part, axis) => part ? [{ size: Math.abs(part), text: pushText(axis, part), detail: texts[axis] }] : []);
  rows.sort((a, b) => b.size - a.size);
  rows.forEach((row, at) => { if (row.detail === rows[at + 1]?.detail) row.detail = ""; }); // said once
  return rows.length ? rows : [{ text: "No push.", detail: texts[0] }];
}

/** Why the strongest push of a sample came: what is said once of several stands at the last of them. */
export const whyOf = rows => rows.find(({ detail }) => detail)?.detail ?? "";

/** Turn a vector by a quaternion, scalar last, of a change of axes; `sign` -1 turns it back. */
function turned([x, y, z, w], vector, sign) {
  const axis = [x, y, z].map(part => -sign * part), side = cross(axis, vector).map(part => 2 * part);
  return plus(plus(vector, scaled(side, w)), cross(axis, side));
}

/**
 * Of a chief that turns, by its attitudes: where points at the start are at a sample, and where a direction of that sample
 * would have been at the start for whoever turns with it.
 */
export function onChief(points, attitude) {
  if (!attitude.length) return {};
  const quaternion = at => Array.from({ length: 4 }, (_, i) => attitude[4 * at + i]);
  const between = (from, to, vector) => turned(quaternion(to), turned(quaternion(from), vector, 1), -1);
  return { pointsAt: k => points.map(point => between(0, k, point)), atStart: (k, vector) => between(k, 0, vector) };
}

/** Where free motion leads from a state over an orbit, by the matrices of a page; null without any. */
export function coasted(rows, state) {
  return rows.length ? Array.from({ length: rows.length / 18 }, (_, at) => [0, 1, 2].map(axis =>
    state.reduce((sum, value, column) => sum + rows[18 * at + 6 * axis + column] * value, 0))) : null;
}

/** Return what FlightView shows. */
export function recordedFlight(table) {
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const floats = text => new Float32Array(bytes(text).buffer);
  const arrays = Object.fromEntries(["points", "attitude", "position", "velocity", "force", "sun", "spent", "coast", "inputs"]
    .map(name => [name, floats(table[name] ?? "")]));
  const isSeen = bytes(table.isSeen), isLitThen = bytes(table.isLit), isDecidedThen = bytes(table.isDecided ?? "");
  const bit = (array, index) => (array[index >> 3] >> (index & 7) & 1) > 0;
  const three = (array, row) => [array[3 * row], array[3 * row + 1], array[3 * row + 2]];
  const numSamples = arrays.spent.length, last = numSamples - 2;
  const force = k => fired(three(arrays.force, k));
  const held = Array.from({ length: table.numPoints }, (_, j) => three(arrays.points, j));
  const coast = k => coasted(arrays.coast, [...three(arrays.position, k), ...three(arrays.velocity, k)]);
  const reasons = k => (k > last ? endedBefore(coast(k)) : reasonsOf(table, k, force(k)));
  return {
    ...table, numSamples, points: held,
    ...onChief(held, arrays.attitude),
    position: k => three(arrays.position, k),
    force: k => (k <= last ? force(k) : [0, 0, 0]),
    numSeen: k => held.filter((_, j) => bit(isSeen, k * table.numPoints + j)).length,
    stride: table.stride ?? 1,
    isDecided: k => Boolean(table.isDecided) && k <= last && bit(isDecidedThen, k),
    inputs: (k, system, count) => arrays.inputs.subarray((k * table.numSystems + system) * 3).slice(0, count),
    sun: k => (arrays.sun.length ? three(arrays.sun, k) : null),
    spent: k => arrays.spent[k],
    isSeen: (k, j) => bit(isSeen, k * table.numPoints + j),
    isLit: (k, j) => bit(isLitThen, k * table.numPoints + j),
    coast,
    why: k => whyOf(reasons(k)),
    reasons,
  };
}

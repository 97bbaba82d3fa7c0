// Flies cases in a worker: told a module and a snapshot first, then what each case has of its own.

let module = null;

const LOGGED = {
  position: "position_m", velocity: "velocity_m_s", force: "force_hill_n", asked: "force_asked_n", change: "safety_force_hill_n",
  sun: "sun_angle_rad", elevation: "sun_elevation_rad", inputs: "fis_input", spent: "delta_v_m_s",
};
const MARKS = { isSeen: "is_inspected", isDecided: "is_decided" };

/** Fly a case, and return its log as arrays; `own` are bytes, those of the arrays `names` one after the other. */
function flown({ names, own }) {
  // what a flight does not decide it does not write, so that of the flight before would stay
  for (const name of [...Object.values(LOGGED), ...Object.values(MARKS)]) module.view(`results.log.${name}`, Uint8Array).fill(0);
  let offset = 0;
  for (const name of names) {
    const array = module.view(name, Uint8Array);
    array.set(own.subarray(offset, offset + array.length));
    offset += array.length;
  }
  module.set("first", 0);
  module.set("last", 1);
  module.call("fly");
  const copied = Object.entries(LOGGED).map(([name, field]) => [name, module.view(`results.log.${field}`).slice()]);
  const marks = Object.entries(MARKS).map(([name, field]) => [name, module.view(`results.log.${field}`, Uint8Array).slice()]);
  return Object.fromEntries([...copied, ...marks, ["counted", module.view("flights.counted", Uint8Array).slice()]]);
}

onmessage = async ({ data }) => {
  try {
    if (data.module) {
      module = await openModule(await inflated(data.module), data.snapshot);
      postMessage({ id: data.id });
      return;
    }
    const log = flown(data);
    postMessage({ id: data.id, log }, Object.values(log).map(({ buffer }) => buffer));
  } catch (error) {
    postMessage({ id: data.id, error: String(error.message ?? error) });
  }
};

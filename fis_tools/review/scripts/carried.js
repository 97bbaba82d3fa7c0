// What the page carries: the controller's systems and its flights, decoded once.

/** Decode a flight: for each system its times, its inputs a row a sample, and how often each rule fired. */
function decodeFlight(flight) {
  const systems = flight.systems.map((flown) => {
    if (flown === null) return null;
    const times = decodeDoubles(flown.time_s);
    const flat = decodeDoubles(flown.inputs);
    const width = flat.length / times.length;
    const inputs = Array.from(times, (_, row) => flat.subarray(row * width, (row + 1) * width));
    const { points, num_inferences: numInferences, is_timed: isTimed } = flown;
    return { times, inputs, fired: decodeDoubles(flown.fired), numInferences, isTimed, points };
  });
  return { name: flight.name, systems };
}

function readCarried() {
  const carried = JSON.parse(document.getElementById("carried").textContent);
  return {
    name: carried.name,
    sha256: carried.sha256,
    systems: carried.systems.map(decodeSystem),
    noun: carried.noun,
    flights: carried.flights.map(decodeFlight),
    brightness: carried.brightness,
    quadrature: { chances: decodeDoubles(carried.quadrature[0]), weights: decodeDoubles(carried.quadrature[1]) },
  };
}

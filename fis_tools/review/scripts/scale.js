// Numbers along axes and in words.

/** Write a number for people: some digits, a true minus sign, none before zero. */
function shown(value, digits = 4) {
  if (!Number.isFinite(value)) return String(value);
  const rounded = Number(value.toPrecision(digits));
  return String(rounded === 0 ? 0 : rounded).replace("-", "−");
}

/** A quantity with its unit; no number is no output. */
function quantity(value, variable, digits = 4) {
  if (Number.isNaN(value)) return "no output";
  return variable.unit ? `${shown(value, digits)} ${variable.unit}` : shown(value, digits);
}

/** A change with its unit, and its sign whichever it is. */
function signed(value, variable, digits = 4) {
  return `${value > 0 ? "+" : ""}${quantity(value, variable, digits)}`;
}

/** A variable's name with its unit, as on an axis. */
function withUnit(variable) {
  return variable.unit ? `${variable.name} (${variable.unit})` : variable.name;
}

/** Round values from low to high, about `count` of them. */
function ticks(low, high, count = 5) {
  if (!(high > low)) return [low];
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A linear map from [low, high] to [start, end]. */
function linear(low, high, start, end) {
  const factor = high === low ? 0 : (end - start) / (high - low);
  return (value) => start + (value - low) * factor;
}

/** Evenly spaced numbers from low to high. */
function spaced(low, high, count) {
  return Array.from({ length: count }, (_, i) => low + ((high - low) * i) / (count - 1));
}

/** The least and the greatest of some numbers, those that are none left out. */
function extremes(values) {
  const numbers = values.filter(Number.isFinite);
  if (!numbers.length) return [0, 0];
  return [numbers.reduce((a, b) => Math.min(a, b)), numbers.reduce((a, b) => Math.max(a, b))];
}

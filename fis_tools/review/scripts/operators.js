// How degrees of truth combine, by name, with the arithmetic of fis_tools/operators.py.

const AND_OPERATORS = {
  min: Math.min,
  product: (a, b) => a * b,
  bounded_difference: (a, b) => Math.max(a + b - 1, 0),
  einstein_product: (a, b) => (a * b) / (2 - (a + b - a * b)),
  hamacher_product: (a, b) => {
    const both = a * b;
    const either = a + b - both;
    return both / (either === 0 ? 1 : either);
  },
  drastic_product: (a, b) => (b >= 1 ? a : a >= 1 ? b : 0),
  nilpotent_minimum: (a, b) => (a + b > 1 ? Math.min(a, b) : 0),
};

const OR_OPERATORS = {
  max: Math.max,
  probabilistic_sum: (a, b) => a + b - a * b,
  bounded_sum: (a, b) => Math.min(a + b, 1),
  einstein_sum: (a, b) => (a + b) / (1 + a * b),
  hamacher_sum: (a, b) => {
    const both = a * b;
    if (both < 0.5) return Math.min((a + b - 2 * both) / (1 - both), 1);
    return both === 1 ? 1 : 1 - ((1 - a) * (1 - b)) / (1 - both);
  },
  drastic_sum: (a, b) => (b <= 0 ? a : a <= 0 ? b : 1),
  nilpotent_maximum: (a, b) => (a + b < 1 ? Math.max(a, b) : 1),
};

const HEDGES = {
  very: (a) => a * a,
  somewhat: (a) => Math.sqrt(Math.max(a, 0)),
  extremely: (a) => a * a * a,
  intensely: (a) => (a <= 0.5 ? 2 * a * a : 1 - 2 * (1 - a) * (1 - a)),
  seldom: (a) => (a <= 0.5 ? Math.sqrt(0.5 * Math.max(a, 0)) : 1 - Math.sqrt(0.5 * Math.max(1 - a, 0))),
};

const AGGREGATIONS = { ...OR_OPERATORS, unbounded_sum: (a, b) => a + b };
const ACCUMULATIONS = { product: AND_OPERATORS.product, ...OR_OPERATORS };

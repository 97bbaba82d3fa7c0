// The share of each rule in an output, as fis_tools/analysis/shapley.py computes it: exact or sampled alike.

const MOST_COALITIONS = 4096;
const NUM_ORDERS = 200;
const SEED = 12;

/** The places of an output's rules that take part: those that fire, at least the strongest. */
function playersOf(system, output, firing) {
  const rules = Array.from(system.rules.keys());
  const concluding = rules.filter((rule) =>
    system.rules[rule].consequents.some(([variable, , weight]) => variable === output && weight > 0),
  );
  const least = Math.min(FIRED, concluding.reduce((most, rule) => Math.max(most, firing[rule]), 0));
  return concluding.filter((rule) => firing[rule] > 0 && firing[rule] >= least);
}

/** Players whose rules join terms with one another: groups of places among the players. */
function joinedPlayers(activations) {
  let joined = [];
  activations.forEach((cuts, player) => {
    const group = { terms: new Set(cuts.map(([term]) => term)), players: [player] };
    const isApart = ({ terms }) => ![...terms].some((term) => group.terms.has(term));
    const others = joined.filter((other) => !isApart(other));
    joined = joined.filter(isApart);
    for (const other of others) {
      other.terms.forEach((term) => group.terms.add(term));
      group.players.push(...other.players);
    }
    joined.push(group);
  });
  return joined.map(({ players }) => players.sort((a, b) => a - b));
}

/** The distinct ways in which some players cut their terms, and where each player leads from each; null for too many. */
function blockOf(players, activations, accumulate, most) {
  const states = [{ cuts: new Map(), members: [] }];
  const places = new Map([["", 0]]);
  const after = [];
  for (const player of players) {
    const leads = states.slice().map(({ cuts, members }) => {
      const joined = new Map(cuts);
      for (const [term, height] of activations[player]) {
        joined.set(term, accumulate ? accumulate(height, joined.get(term) ?? 0) : height);
      }
      const joint = [...members, player];
      const key = accumulate ? [...joined].sort(([a], [b]) => a - b).join(";") : joint.join(";");
      if (!places.has(key)) {
        places.set(key, states.length);
        states.push({ cuts: joined, members: joint });
      }
      return places.get(key);
    });
    if (states.length > most) return null;
    after.push(leads);
  }
  return { players, members: states.map(({ members }) => members), after };
}

/** All blocks of players, or null where there are too many coalitions to enumerate. */
function blocksOf(activations, accumulate) {
  const blocks = [];
  let room = MOST_COALITIONS;
  for (const players of joinedPlayers(activations)) {
    const block = blockOf(players, activations, accumulate, room);
    if (!block) return null;
    blocks.push(block);
    room = Math.floor(room / block.members.length);
  }
  return blocks;
}

/** How probable each state of a block is if each player joins with a chance, one of them for sure or not at all. */
function spreadOf({ members, after }, chance, sure = -1, joins = 0) {
  const found = new Float64Array(members.length);
  found[0] = 1;
  after.forEach((leads, place) => {
    const p = place === sure ? joins : chance;
    const before = found.slice(0, leads.length);
    before.forEach((probability, state) => (found[state] -= p * probability));
    before.forEach((probability, state) => (found[leads[state]] += p * probability));
  });
  return found;
}

/** What coalitions are worth on average for each state of one block; the last block varies fastest in `worths`. */
function expectedWorths(worths, spread, axis) {
  const expected = new Float64Array(spread[axis].length);
  const sizes = spread.map(({ length }) => length);
  worths.forEach((value, place) => {
    let rest = place;
    let probability = 1;
    let state = 0;
    for (let block = sizes.length - 1; block >= 0; block--) {
      const at = rest % sizes[block];
      rest = Math.floor(rest / sizes[block]);
      if (block === axis) state = at;
      else probability *= spread[block][at];
    }
    expected[state] += probability * value;
  });
  return expected;
}

function exactShares(blocks, numPlayers, worth, { chances, weights }) {
  const coalitions = blocks.reduce(
    (joined, { members }) => joined.flatMap((some) => members.map((more) => [...some, ...more])),
    [[]],
  );
  const worths = coalitions.map(worth);
  const values = new Float64Array(numPlayers);
  chances.forEach((chance, node) => {
    const spread = blocks.map((block) => spreadOf(block, chance));
    blocks.forEach((block, axis) => {
      const expected = expectedWorths(worths, spread, axis);
      block.players.forEach((player, place) => {
        const [present, absent] = [spreadOf(block, chance, place, 1), spreadOf(block, chance, place, 0)];
        expected.forEach((value, state) => (values[player] += weights[node] * value * (present[state] - absent[state])));
      });
    });
  });
  return { values, error: 0 };
}

/** The mean of what each player adds over orders in which they join; every second is the one before it reversed. */
function sampledShares(numPlayers, worth) {
  const order = Array.from({ length: numPlayers }, (_, player) => player);
  const pairs = [];
  let state = SEED;
  for (let number = 0; number < NUM_ORDERS; number++) {
    if (number % 2) order.reverse();
    else {
      pairs.push(new Float64Array(numPlayers));
      for (let last = numPlayers - 1; last > 0; last--) {
        state = (Math.imul(1664525, state) + 1013904223) >>> 0;
        const chosen = Math.floor((state * (last + 1)) / 2 ** 32);
        [order[last], order[chosen]] = [order[chosen], order[last]];
      }
    }
    let before = worth([]);
    order.forEach((player, place) => {
      const now = worth(order.slice(0, place + 1));
      pairs.at(-1)[player] += (now - before) / 2;
      before = now;
    });
  }
  const values = Float64Array.from(order, (_, player) => pairs.reduce((sum, pair) => sum + pair[player], 0) / pairs.length);
  const spread = (player) => pairs.reduce((sum, pair) => sum + (pair[player] - values[player]) ** 2, 0);
  const errors = Array.from(values, (_, player) => Math.sqrt(spread(player) / (pairs.length - 1) / pairs.length));
  return { values, error: Math.max(...errors) };
}

/** The share of each rule in an output's way from its default, and the largest standard error of them. */
function shares(system, output, { firing }, quadrature) {
  const variable = system.outputs[output];
  const players = playersOf(system, output, firing);
  const values = new Float64Array(firing.length);
  if (!players.length) return { values, error: 0 };
  const silent = firing.slice();
  for (const rule of players) silent[rule] = 0;
  const worth = (members) => {
    if (!members.length) return variable.default ?? 0;
    const heard = silent.slice();
    for (const player of members) heard[players[player]] = firing[players[player]];
    const { value } = conclude(system, output, heard);
    return variable.default === null && Number.isNaN(value) ? 0 : value;
  };
  const activations = players.map((rule) =>
    system.rules[rule].consequents
      .filter(([place, , weight]) => place === output && weight > 0)
      .map(([, term, weight]) => [term, weight * firing[rule]]),
  );
  const accumulate = variable.accumulation === "product" || variable.aggregation !== "max" ? null : FUZZY[variable.accumulation];
  const blocks = blocksOf(activations, accumulate);
  const found = blocks
    ? exactShares(blocks, players.length, worth, quadrature)
    : sampledShares(players.length, worth);
  players.forEach((rule, player) => (values[rule] = found.values[player]));
  return { values, error: found.error };
}

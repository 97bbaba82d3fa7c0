"""What a format of another program can express of a fuzzy system.

`express` turns a system into the one that a reader of the format sees who knows nothing else: names are
identifiers, rules have the form that the format knows, and what it has no place for is what `fis_tools`
assumes of such a file. The law of every format: reading what was written gives what `express` returned.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby, pairwise
from operator import itemgetter
from typing import cast

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats
from fis_tools.formats.exchange import antecedents
from fis_tools.formats.exchange.antecedents import NotExpressible, is_leaf, with_plain_not
from fis_tools.formats.exchange.vocabulary import HEDGES, Names
from fis_tools.model import Consequent, FuzzySystem, MembershipFunction, Rule, Term, Variable, with_universe
from fis_tools.model.intervals import has_intervals
from fis_tools.model.membership import Format
from fis_tools.model.systems import renamed, with_joint_operators
from fis_tools.words.text import before

#: Points of an output's universe where a file states none: as many as MATLAB's evalfis takes.
OUTPUT_POINTS = 101
#: Points of an input's universe where a file states none. Other programs evaluate the functions themselves,
#: so the points must be close enough to stand for them.
INPUT_POINTS = 1001
#: How near to a point, in steps between points, a corner lies on it.
ON_POINT = 1e-9


@dataclass(frozen=True)
class Dialect:
    """What a format can express.

    Parameters
    ----------
    title : str
        What a file of it is called in a sentence.
    semantics : str
        The program whose inference a file of it means.
    words : {"fis", "fll"}, optional
        Whose words for membership shapes it has; a shape without one is written as a table of points. None
        where every shape can be written.
    holds_descriptions, holds_defaults, holds_clipping : bool
        Which facts of a variable it has a place for.
    resolution : int
        Intervals of an output where a file with a place for their number states none; 0 where there is no
        place.
    output_points : int
        Points of an output's universe where there is no place for their number.
    is_nested : bool
        Whether an antecedent may nest conjunctions and disjunctions.
    repeats_variables : bool
        Whether an antecedent may say two things of one input, and a rule conclude two on one output.
    has_rule_operators : bool
        Whether rules may combine statements in ways of their own.
    has_output_methods : bool
        Whether outputs may be defuzzified and aggregated in ways of their own.
    has_walls : bool
        Whether triangles and trapezoids may rise or fall at once; otherwise a wall at an end of the range
        becomes a flank outside of it, which changes nothing inside.
    has_hedges : bool
        Whether it has fuzzylite's hedges, several before a term and also before what a rule concludes;
        otherwise a rule with one is refused.
    is_read : bool
        Whether there is a reader, so that a comment carries what has no place.
    """

    title: str
    semantics: model.Semantics
    words: Format | None = None
    holds_descriptions: bool = False
    holds_defaults: bool = True
    holds_clipping: bool = False
    resolution: int = 0
    output_points: int = OUTPUT_POINTS
    is_nested: bool = False
    repeats_variables: bool = True
    has_rule_operators: bool = True
    has_output_methods: bool = True
    has_walls: bool = True
    has_hedges: bool = False
    is_read: bool = True


@dataclass(frozen=True)
class Expressed:
    """A system as a format expresses it.

    Parameters
    ----------
    system : FuzzySystem
        What a reader of the format sees.
    rules : tuple of tuple of Rule
        What each rule of the original became.
    """

    system: FuzzySystem
    rules: tuple[tuple[Rule, ...], ...]


def only_system(controller: model.FuzzyController, dialect: Dialect) -> FuzzySystem:
    """Return the one system of a controller; raise Mistake where it has several."""
    return controller.only_system(f"{dialect.title} holds one, so write each into a file of its own")


def express(system: FuzzySystem, dialect: Dialect) -> Expressed:
    """Return a valid system as a format expresses it.

    Raises
    ------
    NotExpressible
        If the format cannot say it without changing what it computes.
    """
    if has_intervals(system):
        raise NotExpressible(f"{dialect.title} has no interval type-2 sets; export as yaml or json")
    refuse_joined(system)
    for output in system.outputs:
        if output.accumulation != "max" and not (dialect.semantics == "fcl" and system.joins_numbers(output)):
            raise NotExpressible(
                f"output {output.name!r} combines rules that conclude one term by {output.accumulation}, "
                f"which {dialect.title} cannot say; export as json"
            )
    system = _with_known_hedges(system, dialect)
    names = Names(system)
    groups = [
        [renamed(rule_part, names.of) for rule_part in _expressed_rules(number, rule, system, dialect)]
        for number, rule in enumerate(system.rules, start=1)
    ]
    methods = tuple(system.defuzzifier_of(output) for output in system.outputs)
    aggregations = sorted({output.aggregation for output in system.outputs})
    for what, choices in (("defuzzified", methods), ("aggregated", aggregations)):
        if len(set(choices)) > 1 and not dialect.has_output_methods:
            raise NotExpressible(
                f"the outputs are {what} by {', '.join(choices)}, and {dialect.title} knows one way for all; "
                "export as fll or json"
            )
    expressed_outputs = (
        _expressed_weighed(system, variable, names, dialect)
        if system.weighs(variable)
        else _expressed_variable(variable, names, dialect, is_output=True)
        for variable in system.outputs
    )
    bare = replace(system, name=names.system, rules=tuple(chain(*groups)), defuzzifier="centroid")
    if len(system.weighed) == len(system.outputs):
        bare = replace(bare, implication="min")
    if system.semantics == dialect.semantics:
        dialect = replace(dialect, has_walls=True)
    inputs = tuple(
        replace(
            _expressed_variable(variable, names, dialect, is_output=False),
            is_clipped=dialect.holds_clipping and (variable.is_clipped or not system.is_sampled),
        )
        for variable in system.inputs
    )
    outputs = tuple(
        replace(o, defuzzifier=method) for o, method in zip(expressed_outputs, methods, strict=True)
    )
    expressed = with_joint_operators(
        replace(bare, inputs=inputs, outputs=outputs, semantics=dialect.semantics)
    )
    if not dialect.has_rule_operators and any(rule.has_own_operators for rule in expressed.rules):
        raise NotExpressible(
            f"rules combine their statements in different ways, and {dialect.title} knows one way for all; "
            "export as fll or json"
        )
    ends = np.cumsum([0, *map(len, groups)])
    return Expressed(expressed, tuple(expressed.rules[start:end] for start, end in pairwise(ends)))


def refuse_joined(system: FuzzySystem) -> None:
    """Refuse a Tsukamoto term that is concluded more than once, which fuzzylite merges into one.

    Raises
    ------
    NotExpressible
        If there are some.
    """
    for output in system.weighed:
        seen: dict[str, int] = {}
        for index, consequent in system.conclusions_on(output):
            term, number = consequent.term, index + 1
            shape = output.terms[output.term_index(term)].membership
            if isinstance(shape, model.MonotoneFunction) and term in seen:
                who = f"rules {seen[term]} and {number} conclude {term!r} of {output.name!r}"
                if seen[term] == number:
                    who = f"rule {number} concludes {term!r} of {output.name!r} twice"
                raise NotExpressible(
                    f"{who}: other programs add the strengths up before they look where the term has them, "
                    "here each counts by itself; conclude a term of its own each time"
                )
            seen[term] = number


def _with_known_hedges(system: FuzzySystem, dialect: Dialect) -> FuzzySystem:
    """Put every hedge before a statement, and refuse those that a format has no word for."""
    known = set(HEDGES) if dialect.has_hedges else set()

    def expressed(number: int, rule: Rule) -> Rule:
        """Return a rule whose hedges stand where the format has words for them."""
        if not any(isinstance(part, model.Hedged) for part in model.parts_of(rule.antecedent)):
            return rule
        outside, statement = before(rule.antecedent)
        concludes = set(outside) <= known and all(c.weight == 1.0 for c in rule.consequents)
        if not (dialect.has_hedges and concludes and not is_leaf(statement)):
            outside, statement = [], rule.antecedent
        try:
            operators = system.and_operator_of(rule), system.or_operator_of(rule)
            moved = with_plain_not(antecedents.on_statements(statement, *operators), *operators)
            for part in model.parts_of(moved):
                words, _ = before(part)
                if {*words} - {"not", *known}:
                    raise NotExpressible(f"it has no word for {' '.join(words)!r}")
        except NotExpressible as reason:
            raise _not_expressible(number, dialect, reason) from reason
        return replace(rule, antecedent=antecedents.hedged(cast(list[model.Hedge], outside), moved))

    rules = tuple(expressed(number, rule) for number, rule in enumerate(system.rules, start=1))
    return replace(system, rules=rules)


def _not_expressible(number: int, dialect: Dialect, reason: NotExpressible) -> NotExpressible:
    """Return an error with the rule's number and the cure."""
    return NotExpressible(
        f"rule {number} cannot be said in {dialect.title}: {reason}; rewrite it, or export as "
        f"{'json' if dialect.is_nested else 'fll or json'}"
    )


def _expressed_rules(number: int, rule: Rule, system: FuzzySystem, dialect: Dialect) -> list[Rule]:
    """Express a rule as one or several, with the names of the original."""
    operators = system.and_operator_of(rule), system.or_operator_of(rule)
    try:
        antecedent = with_plain_not(rule.antecedent, *operators)
        if not dialect.is_nested:
            antecedents.require_flat(antecedent, repeats=dialect.repeats_variables)
    except NotExpressible as reason:
        raise _not_expressible(number, dialect, reason) from reason
    if not dialect.repeats_variables:
        antecedent = antecedents.in_order(antecedent, [variable.name for variable in system.inputs])
    outputs = [output.name for output in system.outputs]
    groups = list(_consequent_groups(rule.consequents, outputs, dialect))
    if isinstance(rule.antecedent, model.Hedged) and not is_leaf(rule.antecedent):
        groups = [(each,) for each in rule.consequents]  # fuzzylite carries a hedge on to those behind it
    return [Rule(antecedent, group, "", *operators) for group in groups]


def _consequent_groups(
    consequents: Sequence[Consequent], outputs: Sequence[str], dialect: Dialect
) -> Iterator[tuple[Consequent, ...]]:
    """Group consequents by weight, and by output where outputs may not repeat."""
    groups: dict[tuple[float, int], list[Consequent]] = {}
    for consequent in consequents:
        key = consequent.weight, 0
        while not dialect.repeats_variables and any(
            other.variable == consequent.variable for other in groups.get(key, ())
        ):
            key = consequent.weight, key[1] + 1
        groups.setdefault(key, []).append(consequent)
    for group in groups.values():
        if not dialect.repeats_variables:
            group.sort(key=lambda consequent: outputs.index(consequent.variable))
        yield tuple(group)


def _expressed_variable(variable: Variable, names: Names, dialect: Dialect, *, is_output: bool) -> Variable:
    """Return a variable as a format can hold it: with identifiers, and the points that its readers use."""
    terms = tuple(
        Term(names.terms[variable.name, term.name], _expressed_membership(variable, term, dialect))
        for term in variable.terms
    )
    ends = float(variable.minimum), float(variable.maximum)
    if is_output:
        universe = np.linspace(*ends, variable.num_points if dialect.resolution else dialect.output_points)
    else:
        universe = input_universe(*ends, [term.membership for term in terms])
    default = variable.default if dialect.holds_defaults else middle(variable.minimum, variable.maximum)
    about = one_line(variable.description) if dialect.holds_descriptions else ""
    bare = Variable(names.variables[variable.name], "", *ends, terms, description=about)
    expressed = replace(bare, default=default if is_output else None, aggregation=variable.aggregation)
    return with_universe(expressed, universe)


def _expressed_weighed(system: FuzzySystem, output: Variable, names: Names, dialect: Dialect) -> Variable:
    """Express a weighted output: its universe does not matter, its terms have words of their own."""
    terms = []
    for term in output.terms:
        shape = term.membership
        is_number = isinstance(shape, model.Number) and dialect.words == "fcl"  # FCL writes formulas
        has_word = isinstance(shape, model.Ramp) or dialect.words in shape.entry.words
        if dialect.words and not (is_number or has_word):
            raise NotExpressible(
                f"output {output.name!r} concludes {term.name!r}, for whose shape, {shape.entry.name}, "
                f"{dialect.title} has no word; export as fll or json"
            )
        if isinstance(shape, model.Formula):
            shape = model.Formula(shape.parsed.text(names.variables))
        terms.append(Term(names.terms[output.name, term.name], shape))
    plain = replace(output, terms=(), num_points=OUTPUT_POINTS, points=None)
    dialect = replace(dialect, output_points=OUTPUT_POINTS)
    expressed = _expressed_variable(plain, names, dialect, is_output=True)
    accumulation: model.Accumulation = "max"
    if dialect.semantics == "fcl":
        accumulation = output.accumulation if system.joins_numbers(output) else "unbounded_sum"
    return replace(expressed, terms=tuple(terms), num_points=OUTPUT_POINTS, accumulation=accumulation)


def _expressed_membership(variable: Variable, term: Term, dialect: Dialect) -> MembershipFunction:
    """Return a term's shape if the format has a word for it, else straight lines between points."""
    shape = term.membership
    if isinstance(shape, model.Ramp) and dialect.words == "fcl":
        (start, end), values = sorted((shape.start, shape.end)), (0.0, 1.0)
        return model.Polyline((start, end), values if shape.start < shape.end else values[::-1])
    has_no_word = dialect.words and dialect.words not in shape.entry.words
    if isinstance(shape, model.SigmoidDifference) and dialect.words == "fcl":
        has_no_word = shape.is_reversed  # jFuzzyLogic takes no absolute value
    if isinstance(shape, model.Sampled) or (
        has_no_word and not isinstance(shape, model.Ramp | model.Polyline)
    ):
        return polyline(variable, term)
    if isinstance(shape, model.Polyline) and dialect.words != "fcl":
        return _without_jumps(shape)
    return shape if dialect.has_walls else without_walls(variable, shape)


def _without_jumps(shape: model.Polyline) -> model.Polyline:
    """Return the same polyline, with a slope up to the next number for a jump, which only FCL can write."""
    points: list[tuple[float, float]] = []
    groups = [
        (x, [y for _, y in group]) for x, group in groupby(zip(shape.x, shape.y, strict=True), itemgetter(0))
    ]
    for (x, heights), (following, _) in pairwise([*groups, (np.inf, [])]):
        points.append((x, heights[0]))
        next_x = float(np.nextafter(x, np.inf))
        if len(heights) > 1 and next_x < following:
            points.append((next_x, heights[-1]))
    return model.Polyline(*map(tuple, zip(*points, strict=True)))


def polyline(variable: Variable, term: Term) -> model.Polyline:
    """Return a term as straight lines between the points of its variable's universe."""
    values = model.sample(variable, term)
    return model.Polyline(tuple(variable.universe.tolist()), tuple(values.tolist()))


def without_walls(variable: Variable, membership: MembershipFunction) -> MembershipFunction:
    """Turn the walls of a triangle or trapezoid at the ends of a range into flanks outside of it."""
    if not isinstance(membership, model.Triangular | model.Trapezoidal):
        return membership
    _, left_top, *_ = corners = [getattr(membership, name) for name in membership.entry.kinds]
    right_top = corners[-2]
    left, right = membership.left, membership.right
    return replace(
        membership,
        left=left_top - variable.span if left == left_top <= variable.minimum else left,
        right=right_top + variable.span if right == right_top >= variable.maximum else right,
    )


def input_universe(
    minimum: float, maximum: float, shapes: Sequence[MembershipFunction], fewest: int = INPUT_POINTS
) -> Floats:
    """Choose points between which other programs' formulas of an input become straight lines.

    They are evenly spaced where some number of points puts one on each corner; else the corners are added.
    Where a function jumps, two points stand next to each other.

    Returns
    -------
    array
        Ascending, `fewest` points or more.
    """
    corners, jumps = corners_of(minimum, maximum, shapes)
    shares = (corners - minimum) / (maximum - minimum)
    counts = np.arange(fewest, fewest + INPUT_POINTS) - 1
    offsets = np.multiply.outer(counts, shares)
    fitting = counts[(np.abs(offsets - np.rint(offsets)) < ON_POINT).all(axis=1)]
    if fitting.size and not jumps.size:
        return np.linspace(minimum, maximum, int(fitting[0]) + 1)
    grid = np.linspace(minimum, maximum, int(fitting[0] if fitting.size else counts[0]) + 1)
    gap = np.spacing(max(abs(minimum), abs(maximum)))  # as near as numbers of the range are to each other
    added = np.concatenate([corners, jumps - gap, jumps + gap])
    near = np.abs(np.subtract.outer(grid[1:-1], corners)).min(axis=1) < ON_POINT * (grid[1] - grid[0])
    return np.union1d(np.concatenate([grid[:1], grid[1:-1][~near], grid[-1:]]), added)


def corners_of(minimum: float, maximum: float, shapes: Sequence[MembershipFunction]) -> tuple[Floats, Floats]:
    """Return the corners of shapes inside a range, and those of them at which one jumps, ascending."""
    inside = [[x for x in shape.corners if minimum < x < maximum] for shape in shapes]
    jumps = [x for corners in inside for x, other in pairwise(corners) if x == other]
    return np.unique([x for corners in inside for x in corners]), np.unique(jumps)


def middle(minimum: float, maximum: float) -> float:
    """Return MATLAB's answer where no rule fires: the middle of the output's range."""
    return 0.5 * minimum + 0.5 * maximum


def one_line(text: str) -> str:
    """Return a text as one line that opens no comment."""
    return " ".join("".join(c if c.isprintable() and c != "#" else " " for c in text).split())

"""What a tube of all starts proves of a requirement."""

from dataclasses import dataclass

from pipeline.evaluation.assurance.formula import Conjunction, Formula, Predicate, Until, Window


@dataclass(frozen=True)
class TubeProof:
    """What a tube of all starts proves: the limit on the speed until the goal (`pipeline.proof`).

    Parameters
    ----------
    fault : str
        Why it proves nothing of these flights; empty if it does.
    is_checked : bool
        Whether the checker, which shares no code with the prover, has accepted the certificate in this run.
    starts, model : str
        In words, the starts and the closed loop that the proof is about.
    end_s : float
        When all flights are at the goal.
    limit : (float, float, float)
        Base (m/s), slope (1/s) and offset (m) of the limit on the speed over the distance.
    goal : (float, float)
        Greatest distance (m) and speed (m/s) at the end.
    """

    fault: str
    is_checked: bool = False
    starts: str = ""
    model: str = ""
    end_s: float = 0.0
    limit: tuple[float, float, float] = (0.0, 0.0, 0.0)
    goal: tuple[float, float] = (0.0, 0.0)

    def proves(self, formula: Formula) -> bool:
        """Return whether ``limit until[0:T] goal`` follows from the tube; False if unclear."""
        base, slope, offset = self.limit
        match formula:
            case Until(Window(0.0, last_s), Predicate(factors, constant), goal) if last_s >= self.end_s:
                of = dict(factors)
                keeps = of.pop("speed", 0.0) == -1.0 and of.pop("distance", 0.0) >= slope and not of
                return keeps and constant >= base - slope * offset - 1e-12 and self._reaches(goal)
        return False

    def _reaches(self, formula: Formula) -> bool:
        """Return whether a formula follows from being at the goal."""
        match formula:
            case Conjunction(left, right):
                return self._reaches(left) and self._reaches(right)
            case Predicate((("distance", -1.0),), constant):
                return constant >= self.goal[0]
            case Predicate((("speed", -1.0),), constant):
                return constant >= self.goal[1]
        return False

"""Control steps a second over champion flights, beside the readable flight in plain order."""

from dataclasses import replace

from benchmarks.timing import best_cpu_seconds, line
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.reference.channels import channels_of
from pipeline.flight.reference.loop import fly, inference_of
from pipeline.flight.simulation import fly_all
from pipeline.flight.starts import evaluation_scenarios

#: the readable flight takes so much longer that fewer of its flights are enough
REFERENCE_FLIGHTS = 12


def run(controller: str, num_flights: int = 1000) -> None:
    """Print steps a second on one thread for both kinds of guidance, beside the readable flight."""
    print(f"Flights: full model, one thread, {num_flights} flights of {controller}, no coasting")
    for kind in ("centroid", "clusters"):
        experiment = compose_experiment(
            [
                "+experiment=evaluate",
                f"controller={controller}",
                f"guidance={kind}",
                "coast_when_complete=false",
            ]
        ).experiment
        mission = experiment.mission
        flown = source.load(experiment.controller, mission)
        cases = replace(experiment.monte_carlo, num_cases=num_flights)
        scenarios = evaluation_scenarios(cases, experiment.sun, experiment.seed)
        seconds = best_cpu_seconds(lambda m=mission, c=flown, s=scenarios: fly_all(m, c, s, workers=1))
        per_step = seconds / (num_flights * mission.num_controls)
        channels, infer = channels_of(flown.systems, flown.force_axes), inference_of(flown.systems)

        def fly_plainly(m=mission, s=scenarios, c=channels, i=infer) -> None:  # type: ignore[no-untyped-def]
            for scenario in s[:REFERENCE_FLIGHTS]:
                fly(m, scenario, c, i)

        plain = best_cpu_seconds(fly_plainly, repeats=3) / (REFERENCE_FLIGHTS * mission.num_controls)
        line(f"guidance={kind}: control steps a second", f"{1.0 / per_step:,.0f}")
        line(f"guidance={kind}: nanoseconds a control step", f"{1e9 * per_step:,.0f}")
        line(f"guidance={kind}: the readable flight, nanoseconds", f"{1e9 * plain:,.0f}")
        line(f"guidance={kind}: times as fast as the readable flight", f"{plain / per_step:.1f}")

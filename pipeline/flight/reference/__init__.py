"""The readable flight, one deputy at a time; twin of `pipeline.flight.period`."""

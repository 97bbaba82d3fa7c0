"""What a flight carries: arrays, vectors of lanes, signals and the log."""

"""One control period: look, decide, act."""

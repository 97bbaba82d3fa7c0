"""The on-board function of a controller as C99, translated from the flight's own Python."""

"""One hour of flight: world, starts, signals, controller, guidance, log."""

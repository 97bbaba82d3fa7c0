"""Numbers about fuzzy systems, as arrays: surfaces, measures, contributions, bounds."""

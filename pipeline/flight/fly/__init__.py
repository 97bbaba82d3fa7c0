"""Who flies: many flights at once, one logged, one period at a time, rehearsals."""

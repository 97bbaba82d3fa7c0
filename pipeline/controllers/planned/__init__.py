"""Baseline controllers: each plans the whole flight from its start; none reacts to what is inspected."""

"""Assurance: requirements as formulas, evaluated over many flights, tested by search, backed by proofs."""

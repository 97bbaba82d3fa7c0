"""Assurance: requirements as formulas, judged over many flights, attacked by search, backed by proofs."""

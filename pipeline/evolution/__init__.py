"""Evolution: a vector of genes in [0, 1] and a fitness function in, a champion out."""

from pipeline.evolution.rounds import Evaluate, Evolution, OnGeneration, evolve, evolve_rounds

__all__ = ["Evaluate", "Evolution", "OnGeneration", "evolve", "evolve_rounds"]

"""Evolution: from a vector of genes in [0, 1] and a fitness function to a champion or a front."""

from pipeline.training.evolution.generations import Evaluate
from pipeline.training.evolution.nsga2 import OBJECTIVE, Front
from pipeline.training.evolution.rounds import Evolution, OnGeneration, evolve_rounds

__all__ = ["OBJECTIVE", "Evaluate", "Evolution", "Front", "OnGeneration", "evolve_rounds"]

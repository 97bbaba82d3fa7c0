"""Training: the fitness, the genome, the evolution."""

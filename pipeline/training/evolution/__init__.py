"""Evolution: from a vector of genes in [0, 1] and a fitness function to a champion or a front."""

"""Monte Carlo evaluation, its statistics, and the comparison of controllers."""

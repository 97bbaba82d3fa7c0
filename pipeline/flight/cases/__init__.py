"""What a case draws: its start, dispersions, errors of fixes and thrusters, drag in time."""

"""What a case draws besides its start: dispersions, errors of fixes and thrusters, drag in time."""

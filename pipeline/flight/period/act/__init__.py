"""What becomes of a command: safety, aim, thrusters, rotation, motion."""

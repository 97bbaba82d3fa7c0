"""The commands, one file a command: what is asked for, and what is done with it."""

"""The scalar functions of inference, transcribed from those that run; pages have them as JavaScript."""

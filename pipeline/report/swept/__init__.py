"""What a sweep comes to: its runs, the effects of what they differ in, the front, and how to fly the best."""

"""Controllers that need no inspection to decide: each plans its forces from the start, by a known method."""

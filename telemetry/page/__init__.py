"""A page that plays flights: scene, plots, points and reasons under one time, for recordings and for runs."""

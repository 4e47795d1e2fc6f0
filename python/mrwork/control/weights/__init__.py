"""Weights of a regulator from limits on rms responses and a budget of force, by convex optimisation."""

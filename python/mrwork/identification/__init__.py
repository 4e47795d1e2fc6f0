"""From tests to an identified damper: explore with a search, refine on the JAX twin, say how good it is."""

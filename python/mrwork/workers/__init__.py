"""Work on the executors of others: chunks of runs and fits, whose results do not depend on who computes them."""

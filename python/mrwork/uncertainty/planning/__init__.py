"""Choice of the next test: which candidate reduces the variance of a quantity most."""

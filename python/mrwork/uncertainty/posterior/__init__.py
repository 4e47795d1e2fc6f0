"""Posterior of parameters and noise: priors, target density, ensemble and NUTS samplers, draws with diagnostics."""

"""Posterior of parameters and noise: priors, target density, ensemble sampler, draws with diagnostics."""

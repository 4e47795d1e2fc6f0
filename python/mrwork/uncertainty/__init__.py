"""How sure: noise models, posteriors, identifiability, bands whose coverage is measured, and the choice of model."""

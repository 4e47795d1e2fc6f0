"""Bands: of the parameters (what the fit does not know) and of prediction (where a measurement will lie)."""

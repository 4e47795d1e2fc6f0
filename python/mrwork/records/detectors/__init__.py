"""Detectors of defects in a test, one algorithm per file."""

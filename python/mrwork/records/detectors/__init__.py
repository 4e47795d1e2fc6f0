"""Detectors: what a test may suffer from, one file each."""

"""Detectors of defects of a test, one file each."""

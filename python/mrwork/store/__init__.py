"""Mechanism of files: journals, run folders, codec, fingerprints. The file of a type is defined beside the type."""

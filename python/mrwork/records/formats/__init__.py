"""Readers of the file formats of damper tests."""

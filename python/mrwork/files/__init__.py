"""Formats of files as named columns."""

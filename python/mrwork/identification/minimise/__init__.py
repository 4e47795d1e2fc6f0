"""Searches of a minimum of the misfit."""

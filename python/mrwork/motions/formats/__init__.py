"""Readers of the file formats of ground motions."""

"""The page of a fit: its sections, each in a file of its own, and `page`, which lists them and puts them together."""

"""A damper and a law as programs outside of Python: C, and FMUs around it."""

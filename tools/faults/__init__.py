"""Verbs ended, called oddly and given files that are wrong or lie, in the long form that takes hours."""

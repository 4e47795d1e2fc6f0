"""Fuzzing of every reader: damaged copies of files that the tests make, read in processes with limits."""

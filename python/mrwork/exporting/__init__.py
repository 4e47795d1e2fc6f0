"""Runs in the forms of other programs: MATLAB, OpenSees, tables for a supplier."""

"""Identifiability of parameters: Fisher information, unidentifiable directions, profile likelihood."""

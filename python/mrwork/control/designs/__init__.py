"""Designs of the control laws: settings declared once, and the numbers that follow from them."""

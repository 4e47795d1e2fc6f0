"""Linear plants, Riccati equations, regulators and margins."""

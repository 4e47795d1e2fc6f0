"""Closed loop in JAX, with the steps of the Rust loop: building, dampers, driver and law, differentiable."""

"""Damper models as the Rust core declares them: parameters, current laws, published sets, conversions, coordinates."""

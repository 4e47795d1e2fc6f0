"""Closed loop in JAX: building, dampers, driver and control law, differentiable in all parameters.

The steps are those of the Rust loop. `run` simulates: `run_loop` accumulates the results, `loop_histories` returns
histories, `half_steps` tabulates the ground motion. `plant` has building and devices, `laws` the control laws, and
`riccati` the gains.
"""

"""The closed loop in JAX: building, dampers, driver and a smooth control law, differentiable in all of them.

The steps are those of the Rust loop. `run.run_loop` reduces a run as it goes on, `run.loop_histories` keeps it;
`plant`, `laws` and `riccati` say what is controlled, how, and where gains come from; `ground` tabulates the motion.
"""

"""A building with its dampers, driver and controller as a sampled loop, and how well it does."""

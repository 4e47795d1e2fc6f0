"""A study in a TOML file: a building, its dampers, control laws and ground motions, and how they respond."""

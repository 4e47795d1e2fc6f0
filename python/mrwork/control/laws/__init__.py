"""Settings of control laws, a family a file, and the plants and weights that they design with."""

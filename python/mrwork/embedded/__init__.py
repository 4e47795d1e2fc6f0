"""C of dampers and controllers for rigs, and FMUs: printed from the formulas that the lanes run."""

"""Which model: families compared by what their fits have not seen, by leave-one-out densities, and by BIC."""

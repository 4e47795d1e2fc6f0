"""Choice of model: families compared by errors on tests left out of their fits."""

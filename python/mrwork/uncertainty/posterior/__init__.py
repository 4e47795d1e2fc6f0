"""What the data leave possible: draws of the parameters and of the noise, and how good these are."""

"""Parameter bands of the model's force, and calibrated prediction bands of the measured force."""

"""Which parameters the data tell: Fisher information, directions that nothing sees, profiles of the likelihood."""

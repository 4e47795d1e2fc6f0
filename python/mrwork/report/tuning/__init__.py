"""The page of a tuning of control laws."""

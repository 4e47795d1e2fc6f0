"""Programs for those who work on mrwork."""

"""The page of a study of buildings with dampers."""

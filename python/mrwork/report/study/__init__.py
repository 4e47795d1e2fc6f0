"""The page of a study of buildings with dampers, and the folder it lies in."""

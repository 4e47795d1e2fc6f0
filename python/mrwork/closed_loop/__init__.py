"""Buildings with dampers and controllers under ground motions: a typed face of the Rust core."""

"""Ground motions: read from the formats of the field, made by a seeded generator, scaled, cut, corrected."""

from mrwork.motions.ground_motion import GroundMotion

__all__ = ["GroundMotion"]

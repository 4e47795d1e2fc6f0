"""Buildings: mass, damping and stiffness from a file, a shear frame or a publication, and what is put into them."""

from mrwork.buildings.building import Building

__all__ = ["Building"]

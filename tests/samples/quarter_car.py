"""A quarter car: a wheel on a tyre, and a body on a suspension with a damper."""

import numpy as np

import mrwork as mr

BODY, WHEEL = 300.0, 40.0
SPRING, DASHPOT = 18e3, 300.0
TYRE, TYRE_DASHPOT = 190e3, 150.0


def quarter_car() -> mr.Building:
    """Its coordinates are heights over the road, of the wheel and of the body."""
    return mr.Building(
        name="quarter car",
        mass=np.diag([WHEEL, BODY]),
        damping=np.array([[TYRE_DASHPOT + DASHPOT, -DASHPOT], [-DASHPOT, DASHPOT]]),
        stiffness=np.array([[TYRE + SPRING, -SPRING], [-SPRING, SPRING]]),
        influence=np.ones(2),
        floors=np.eye(2),
        storeys=np.array([[1.0, 0.0], [-1.0, 1.0]]),
        floor_names=("wheel", "body"),
        storey_names=("tyre", "suspension"),
    )


CAR = """
[building]
name = "quarter car"
mass = [[40.0, 0.0], [0.0, 300.0]]
damping = [[450.0, -300.0], [-300.0, 300.0]]
stiffness = [[208e3, -18e3], [-18e3, 18e3]]
influence = [1.0, 1.0]
floors = [[1.0, 0.0], [0.0, 1.0]]
storeys = [[1.0, 0.0], [-1.0, 1.0]]
floor_names = ["wheel", "body"]
storey_names = ["tyre", "suspension"]

[[damper]]
storey = "suspension"
model = "bingham"
parameters = { f_c = [50.0, 950.0], v_s = 0.02, c0 = 500.0, f0 = 0.0 }
largest_command = 1.0
"""
"""Tables of a study file."""

ROAD = """
[[motion]]
synthetic = "iso_8608"
road_class = "C"
speed = "72 km/h"
duration = 4.0
"""

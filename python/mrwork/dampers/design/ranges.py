"""Arguments of a design: ranges of quantities, within which no formula of the room overflows, and common shapes."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import Within
from mrwork.errors import SettingError

# From a micrometre to a hundred metres.
Length = Annotated[float, Within(least=1e-6, most=100.0)]
Viscosity = Annotated[float, Within(least=1e-6, most=1e6)]
FlowIndex = Annotated[float, Within(least=0.1, most=3.0)]
Speed = Annotated[float, Within(least=1e-9, most=1e3)]
Turns = Annotated[int, Within(least=1, most=1_000_000)]
Current = Annotated[float, Within(least=1e-6, most=1e4)]
Voltage = Annotated[float, Within(least=1e-3, most=1e6)]
# Arrays of numbers that are not negative, and what a current or a velocity may be.
Stresses = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Flows = Annotated[ArrayLike, Within(least=0.0, most=1e3)]
Fields = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Currents = Annotated[ArrayLike, Within(least=0.0, most=1e4)]
Velocities = Annotated[ArrayLike, Within(least=-1e3, most=1e3)]


def broadcast(function: str, **values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Arguments of a function as arrays of the shape to which they broadcast.

    Raises
    ------
    SettingError
        If they do not; the message names them.
    """
    arrays = [np.asarray(value, dtype=np.float64) for value in values.values()]
    try:
        return tuple(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(f"`{name}` {array.shape}" for name, array in zip(values, arrays, strict=True))
        raise SettingError(
            f"arguments of {function} have the shapes {shapes}; give shapes that broadcast against each other"
        ) from None

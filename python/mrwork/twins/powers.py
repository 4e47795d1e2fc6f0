"""Powers and roots of arrays of any library, with finite derivatives at zero."""

from __future__ import annotations

from typing import Any

import numpy as np


def _library(array: Any) -> Any:
    """The functions of the library of an array, as the array API names them; NumPy's for plain numbers."""
    own = getattr(array, "__array_namespace__", None)
    return np if own is None else own()


def power(base: Any, exponent: Any) -> Any:
    """`base ** exponent` for base >= 0 and exponent >= 1, with finite derivatives at zero."""
    library, positive = _library(base), base > 0.0
    return library.where(positive, library.where(positive, base, 1.0) ** exponent, 0.0)


def root(square: Any) -> Any:
    """Square root, with a derivative of zero at zero."""
    library, positive = _library(square), square > 0.0
    return library.where(positive, library.sqrt(library.where(positive, square, 1.0)), 0.0)

"""Functions of NumPy that make a number of numbers, each by operations of the core.

Apart from the arrays of `traced.py`: a function is added here by its line alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from mrwork.base import recording as rec
from mrwork.base.angles import angle, cosine, sine
from mrwork.base.recording import put

ARITHMETIC: Final[dict[Any, Callable[..., Any]]] = {
    np.add: lambda a, b: put("add", a, b),
    np.subtract: lambda a, b: put("subtract", a, b),
    np.multiply: lambda a, b: put("multiply", a, b),
    np.negative: lambda a: put("negative", a),
    np.positive: lambda a: a,
    np.absolute: lambda a: put("absolute", a),
    np.square: lambda a: put("multiply", a, a),
    np.minimum: rec.smaller,
    np.maximum: rec.larger,
    np.fmin: lambda a, b: rec.choose(rec.is_none(a), b, rec.choose(rec.is_none(b), a, rec.smaller(a, b))),
    np.fmax: lambda a, b: rec.choose(rec.is_none(a), b, rec.choose(rec.is_none(b), a, rec.larger(a, b))),
    np.sign: rec.sign,
}
"""Functions that make whole numbers of whole numbers."""
_OF_NUMBERS: Final[dict[Any, Callable[..., Any]]] = {
    np.divide: lambda a, b: put("divide", a, b),
    np.reciprocal: lambda a: put("divide", 1.0, a),
    np.fabs: lambda a: put("absolute", a),
    np.sqrt: lambda a: put("sqrt", a),
    np.copysign: lambda a, b: put("copysign", a, b),
    np.rint: lambda a: put("rint", a),
    np.floor: rec.floor,
    np.ceil: rec.ceil,
    np.trunc: rec.trunc,
    np.heaviside: rec.heaviside,
    np.exp: lambda a: put("exp", a),
    np.log: lambda a: put("log", a),
    np.log2: lambda a: put("divide", put("log", a), math.log(2.0)),
    np.log10: lambda a: put("divide", put("log", a), math.log(10.0)),
    np.tanh: lambda a: put("tanh", a),
    np.power: rec.power,
    np.float_power: rec.power,
    np.hypot: rec.hypot,
    np.sin: sine,
    np.cos: cosine,
    np.tan: lambda a: put("divide", sine(a), cosine(a)),
    np.arctan: lambda a: angle(a, 1.0),
    np.arctan2: angle,
    np.arcsin: lambda a: angle(a, put("sqrt", put("multiply", put("subtract", 1.0, a), put("add", 1.0, a)))),
    np.arccos: lambda a: angle(put("sqrt", put("multiply", put("subtract", 1.0, a), put("add", 1.0, a))), a),
    np.deg2rad: lambda a: put("multiply", a, math.pi / 180.0),
    np.rad2deg: lambda a: put("multiply", a, 180.0 / math.pi),
}
CONDITIONS: Final[dict[Any, Callable[..., Any]]] = {
    np.less: rec.less,
    np.greater: lambda a, b: rec.less(b, a),
    np.less_equal: rec.at_most,
    np.greater_equal: lambda a, b: rec.at_most(b, a),
    np.equal: lambda a, b: put("equal", a, b),
    np.not_equal: lambda a, b: rec.negation(put("equal", a, b)),
    np.logical_and: rec.both,
    np.logical_or: rec.either,
    np.logical_xor: lambda a, b: rec.negation(put("equal", rec.truth(a), rec.truth(b))),
    np.logical_not: lambda a: rec.negation(rec.truth(a)),
    np.isfinite: rec.is_finite,
    np.isnan: rec.is_none,
    np.isinf: lambda a: put("equal", put("absolute", a), math.inf),
}
"""Functions that make truths."""
OF_TRUTHS: Final = {
    np.add: np.logical_or,
    np.multiply: np.logical_and,
    np.bitwise_or: np.logical_or,
    np.bitwise_and: np.logical_and,
    np.bitwise_xor: np.logical_xor,
    np.invert: np.logical_not,
}
"""Functions that are others where all they take are truths."""
SCALARS: Final = ARITHMETIC | _OF_NUMBERS | CONDITIONS
"""What each makes of numbers."""
IN_WORDS = (
    "+ - * / ** @, comparisons, & | ~ of conditions, np.where, np.minimum, np.maximum, np.clip, np.sign, np.sqrt, "
    "np.exp, np.log, np.tanh, np.sin, np.cos, np.arctan2, np.rint, np.floor, np.interp, sums and means"
)
"""Functions that are recorded, for messages."""

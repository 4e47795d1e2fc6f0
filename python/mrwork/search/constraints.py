"""Constraints in a search for one misfit, given as columns beside it."""

from __future__ import annotations

import numpy as np

from mrwork.arguments import AnyArrayLike, checked
from mrwork.errors import SettingError
from mrwork.values import Floats

INFEASIBLE = 1e12
"""From this misfit on no point meets every constraint; misfits are expected to be smaller."""


@checked
def misfit_under_constraints(columns: AnyArrayLike) -> Floats:
    """Misfits that rank points by Deb's rules, shape (m,), for a search or between `ask` and `tell`.

    Points that meet every constraint keep their misfit. The others have 1e12 (1 + v), v the sum of their violations,
    and so come after these, the least violation first; a `best_misfit` of 1e12 or more says that no point was feasible.

    Parameters
    ----------
    columns
        A misfit and constraints g, met where g <= 0, for each point, shape (m, 1 + n_constraints). Divide each g by
        what counts as much of it. A point with a NaN is infinite.

    Raises
    ------
    SettingError
        Where `columns` has no two axes or no column of constraints, or a misfit is 1e12 or more and finite.

    Notes
    -----
    Deb, Comput. Methods Appl. Mech. Eng. 186, 2000, 311-338.

    Examples
    --------
    >>> import numpy as np
    >>> from mrwork.search import EfficientGA, misfit_under_constraints, run_search
    >>> def columns(unit):
    ...     return np.column_stack([unit[:, 0] ** 2 + unit[:, 1], 0.5 - unit[:, 0]])
    >>> found = run_search(
    ...     EfficientGA(), lambda unit: misfit_under_constraints(columns(unit)), rng=0, n_params=2
    ... )
    >>> bool(found.best_unit[0] >= 0.5 and found.best_misfit < 0.27)
    True
    """
    given = np.asarray(columns, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] < 2:
        raise SettingError(
            f"`columns` has the shape {given.shape}; give (m, 1 + n_constraints), a misfit and constraints g <= 0"
        )
    misfit, constraints = given[:, 0], given[:, 1:]
    if np.any((misfit >= INFEASIBLE) & np.isfinite(misfit)):
        raise SettingError(
            f"a misfit is {INFEASIBLE:g} or more, which is for points that miss a constraint; scale the misfits"
        )
    violation = np.maximum(constraints, 0.0).sum(axis=1)
    ranked = np.where(violation > 0.0, INFEASIBLE * (1.0 + violation), misfit)
    return np.asarray(np.where(np.isnan(given).any(axis=1), np.inf, ranked))

"""Draws that `mrwork sample` left in a run directory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.report.reopen import OpenedRun
from mrwork.report.run_directory import DRAWS


def stored_draws(opened: OpenedRun) -> NDArray[np.float64] | None:
    """Parameters of the posterior's draws, shape (n_draws, n_params), in the order of the fit; `None` without any.

    Raises
    ------
    RecordError
        Where the file cannot be read, or is of another model.
    """
    path = opened.place / DRAWS
    if not path.is_file():
        return None
    # Slow to load.
    import xarray

    try:
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            columns = [np.asarray(tree["posterior"][name]).ravel() for name in opened.fit.spec.names]
    except (OSError, KeyError, ValueError) as reason:
        raise RecordError(
            f"{path} does not hold draws of {opened.fit.model} ({reason}); run `mrwork sample` again"
        ) from None
    return np.stack(columns, axis=-1)

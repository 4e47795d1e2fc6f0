"""A study file whose dampers may be those of run folders: what joins the two wings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from mrwork.base.arguments import Seed, checked
from mrwork.base.values import Floats
from mrwork.dampers.tested_range import FittedDamper
from mrwork.study import reading
from mrwork.study.course import StudyProgress
from mrwork.study.dampers import Identified
from mrwork.study.study import Study


def fitted_damper(run: Path) -> FittedDamper:
    """The fit of a run folder as a study takes it."""
    # Most studies name no run, and the wing of identification takes half as long again to load.
    from mrwork.identification.fit_file import read_fit, read_others
    from mrwork.uncertainty.posterior.draws import read_draws

    fit = read_fit(run)

    def draws() -> Floats | None:
        stored_draws = read_draws(run, fit)
        return (
            None
            if stored_draws is None
            else np.asarray(stored_draws.chains.reshape(-1, stored_draws.chains.shape[-1]))
        )

    chosen = FittedDamper(spec=fit.spec, theta=fit.theta, tested=fit.tested, draws=draws)
    # Draws of the chosen set only are known.
    others = tuple(
        replace(chosen, spec=each.spec, theta=each.theta, draws=partial(np.atleast_2d, np.array(each.theta)))
        for each in read_others(run, fit) or ()
    )
    return replace(chosen, others=others)


@checked
def read_study(
    path: str | Path,
    identified: Identified = fitted_damper,
    *,
    seed: Seed = 0,
    on_python: Callable[[str], None] = lambda sentence: None,
    on_progress: Callable[[StudyProgress], None] | None = None,
) -> Study:
    """Read a study.

    Parameters
    ----------
    path
        The TOML file; names of other files in it are relative to its folder.
    identified
        Reads model and parameters from the folder of an identified damper.
    seed
        Seed of noise and synthetic motions.
    on_python
        Called with a sentence that names the file of each law in Python, before any of these files runs.
    on_progress
        Called with the progress of the runs from which settings are taken that laws of the study leave out.

    Raises
    ------
    RecordError
        If the file does not exist or is not text.
    SettingError
        If anything in it is wrong; the message has file and line.
    """
    return reading.read_study(path, identified, seed=seed, on_python=on_python, on_progress=on_progress)

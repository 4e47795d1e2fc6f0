"""The score of a study as a function of the settings of a law, for JAX, with derivatives through the closed loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import Threads, checked
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box, Coordinates
from mrwork.errors import SettingError
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.law_plan import LawPlan, without_gradient
from mrwork.tuning.space import LARGEST
from mrwork.tuning.tuned_laws import settings_in_words
from mrwork.tuning.tuning_run import plan_of
from mrwork.twins.model_twins import begin
from mrwork.twins.traced_function import TracedFunction

_OUTSIDE_SPACE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, weakref_slot=True)
class _StudyScore:
    """The score as a function of settings; the simulation is called back from the program of JAX."""

    plan: LawPlan
    box: Box

    def __call__(self, settings: Array, _: Any) -> Array:
        return _score(self, settings)

    def values(self, settings: Floats) -> Floats:
        """Scores of settings, (..., n_free), shape (...)."""
        units, _, inside = self.places(settings)
        values = np.full(len(units), math.inf)
        if inside.any():
            values[inside] = self.plan.values(units[inside], exact=True)
        return values.reshape(settings.shape[:-1])

    def linearise(self, settings: Floats) -> tuple[Floats, Floats]:
        """Scores of settings, (..., n_free), and their derivatives."""
        units, rates, inside = self.places(settings)
        values, slopes = np.full(len(units), math.inf), np.zeros(units.shape)
        for row in np.flatnonzero(inside):
            values[row], slopes[row] = self.plan.slopes(units[row])
            slopes[row] *= rates[row]
        return values.reshape(settings.shape[:-1]), slopes.reshape(settings.shape)

    def places(self, settings: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Places of settings in their ranges with their slopes, (n, n_free), and which rows have them."""
        rows = np.asarray(settings).reshape(-1, len(self.box.names))
        # Rounding of a range that is logarithmic leaves its ends.
        theta = np.clip(rows, self.box.lower, self.box.upper)
        inside: NDArray[np.bool_] = np.all(np.isclose(rows, theta, rtol=_OUTSIDE_SPACE, atol=0.0), axis=1)
        theta[~inside] = self.box.upper
        return np.clip(self.box.unit_from_theta(theta), 0.0, 1.0), 1.0 / self.box.unit_slope(theta), inside


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["data"],
    meta_fields=["title", "compute", "box", "units", "coordinates", "start", "held"],
)
@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class StudyScore(TracedFunction):
    """A `TracedFunction` that is the score of a study, with the law of a point."""

    compute: _StudyScore

    def settings(self, point: ArrayLike) -> dict[str, Any]:
        """All settings of the law at a point, shape (n_free,), those that are held among them.

        A study with a law of these settings has the score of the point, to the bit.

        Raises
        ------
        SettingError
            If the point is not one inside the ranges.
        """
        units, _, inside = self.compute.places(np.asarray(self.parameters(point)))
        if inside.shape != (1,) or not inside[0]:
            raise SettingError(
                f"the point {np.asarray(point).tolist()} is not one inside the ranges; give {len(self.names)} numbers "
                "from `lower` to `upper`"
            )
        return self.compute.plan.space.candidate(units[0], exact=True).of_law

    def law(self, point: ArrayLike) -> dict[str, Any]:
        """The law of a point, shape (n_free,), as `mr.study_of(laws=[...])` takes it; see `settings`."""
        return {"law": self.compute.plan.law, "settings": self.settings(point)}


def _numbers(shape: tuple[int, ...]) -> Any:
    made: Any = jax.ShapeDtypeStruct
    return made(shape, jnp.float64)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _score(of: _StudyScore, settings: Array) -> Array:
    shape = _numbers(settings.shape[:-1])
    score: Array = jax.pure_callback(of.values, shape, settings, vmap_method="expand_dims")
    return score


@_score.defjvp
def _differentiate(of: _StudyScore, primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    score, slopes = _linearise(of, primals[0])
    return score, jnp.sum(slopes * tangents[0], axis=-1)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _linearise(of: _StudyScore, settings: Array) -> tuple[Array, Array]:
    shapes = (_numbers(settings.shape[:-1]), _numbers(settings.shape))
    score, slopes = jax.pure_callback(of.linearise, shapes, settings, vmap_method="expand_dims")
    return score, slopes


@_linearise.defjvp
def _refuse_second(of: _StudyScore, primals: object, tangents: object) -> Any:  # noqa: ARG001, of the rule
    raise SettingError(
        "the scores of mr.jax have first derivatives; take second ones by differences of gradients"
    )


@checked
def study_score(
    study: Study, law: str | TuneTable, *, coordinates: Coordinates = "theta", threads: Threads = 0
) -> StudyScore:
    """The score of a study as a function of the free settings of a law, for JAX: that which `mr.tune` minimises.

    Its derivatives go through the closed loop: building, dampers, driver, observer, delay, sampled commands, as they
    are simulated. Settings that are not free are held, and shown by `print`: the table's, `drifts = 1` of a
    regulator without weights, and the starts of others. `score.settings(point)` and `score.law(point)` have them all.

    Parameters
    ----------
    law
        The name of a law, of which the table of the study that tunes it decides, if there is one; or such a table,
        `mr.study.TuneTable(laws=(law,), ...)`, with criteria, risk, constraints and free settings of its own. The
        largest command is always the dampers' own.
    coordinates
        Whether a point is the settings, "theta", their places in their ranges from 0 to 1, "unit", or the logits of
        these, "latent".

    Returns
    -------
    StudyScore
        Of a point, shape (n_free,), the score: infinite outside the ranges and where the settings make no law or a run
        has no end, with derivatives of zero. A derivative is not a number where settings next to it make no law.

    Raises
    ------
    SettingError
        Where the law switches, so that its score jumps, or something else in the study has no gradient.

    Examples
    --------
    >>> import jax, jax.numpy as jnp, mrwork as mr
    >>> score = mr.jax.study_score(mr.read_study("study.toml"), "proportional_direct")  # doctest: +SKIP
    >>> jax.grad(score)(jnp.array(score.start))  # doctest: +SKIP
    Array([-0.0123, 0.0045], dtype=float64)
    >>> mr.study_of(building=building, motions=motions, laws=[score.law(score.start)])  # doctest: +SKIP
    """
    begin()
    if isinstance(law, TuneTable):
        table = law
    else:
        table = next((tune for tune in study.tunes if law in tune.laws), TuneTable(laws=(law,)))
        table = replace(table, laws=(law,))
    if len(table.laws) != 1:
        raise SettingError(f"the table has {len(table.laws)} laws; give one")
    if lacking := without_gradient(study, table):
        raise SettingError(lacking)
    plan = plan_of(study, replace(table, gradient_steps=0), threads)
    free = tuple(setting for setting in plan.space.free if setting.name != LARGEST)
    if not free:
        raise SettingError(f"{plan.law} has no free setting but the largest command; free one that it has")
    space = replace(plan.space, free=free)
    plan = replace(plan, space=space)
    plan.check_slopes()
    box = Box(
        names=tuple(setting.label for setting in free),
        lower=tuple(setting.lower for setting in free),
        upper=tuple(setting.upper for setting in free),
        log=tuple(setting.scale == "log" for setting in free),
    )
    return StudyScore.of(
        f"Score of {plan.law} in {study.title}",
        _StudyScore(plan=plan, box=box),
        box=box,
        units=("",) * len(free),
        coordinates=coordinates,
        start=np.array([setting.value(setting.start, exact=True) for setting in free]),
        data=None,
        held=settings_in_words({**space.held, LARGEST: space.largest_command}, study.command_unit),
    )

"""Draws with what ArviZ computes from: densities of the data, predictions, the prior and the data themselves.

It stands apart from the draws and their file, because it simulates every draw again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from mrwork.base.arguments import Count, Seed, Threads, checked
from mrwork.base.labelled import NamedArray, NamedArrays, number_labels
from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.identification.covariance import autocorrelation_time
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.uncertainty.choice.leave_one_out import block_densities, blocks_of
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws
from mrwork.uncertainty.posterior.target import Prior, Space, Target, target_of

if TYPE_CHECKING:
    from xarray import DataTree

Pointwise = Literal["blocks", "samples"]

# Points at which a prior density is tabulated between the bounds of its parameter.
_GRID = 2001
_ZOOMS = 4
# Log density below the largest from which on there is no mass.
_NEGLIGIBLE = 40.0
# Rounds of rejection for the pair of k and k x0, of which half is kept.
_ROUNDS = 60


@checked
def inference_data(
    draws: Draws,
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    priors: Mapping[str, Prior] | None = None,
    pointwise: Pointwise = "samples",
    most_draws: Count = 1000,
    rng: Seed = 0,
    threads: Threads = 0,
) -> DataTree:
    """Draws as a `DataTree` for ArviZ, with units of every variable, after simulating them again.

    The groups are `posterior`, `sample_stats`, `log_likelihood`, `posterior_predictive`, `prior` and `observed_data`.
    `arviz_stats.loo` takes the tree as it is.

    `log_likelihood` has the one variable `force`. Its entries are densities under the noise model of the draws, in
    deviations of each test's force, times `temper`, as they were sampled: where residuals are correlated, the sum over
    all samples counts for as many as are effective. Leave-one-out over single samples takes these as independent given
    the parameters, also under "iid", "student_t" and "amplitude" noise. Residuals of real tests are not: its elpd is
    that of interpolation between neighbours, and too good, with too small an error. Under "ar1" and "arma11" noise
    each density is given the earlier residuals, and is of the next sample. Densities of "blocks" are of whole cycles,
    longer than the autocorrelation time of the residuals at the fit, which are nearly independent; a record has few,
    and ArviZ then warns of heavy tails. `choose_model` compares models by blocks, and by tests that are left out.

    `posterior_predictive` has the recorded force with noise [N], of the samples that are compared. As in `sample`,
    every test has its own deviation; the weights of tests in the search do not enter.

    Parameters
    ----------
    draws
        Draws of `sample`.
    fit, tests
        The fit and the tests that were sampled.
    priors
        Those that `sample` was given.
    pointwise
        Whether densities are of blocks or of single samples.
    most_draws
        Largest number of draws, of which evenly spaced ones are kept, of every walker.
    rng
        Seed of the noise of the predictions and of the prior.
    threads
        Threads of the simulation, 0 for all.

    Raises
    ------
    SettingError
        Where the draws are of another model.

    Examples
    --------
    >>> import arviz_stats, mrwork as mr  # doctest: +SKIP
    >>> tree = mr.uncertainty.inference_data(mr.sample(fit, test), fit, test)  # doctest: +SKIP
    >>> arviz_stats.loo(tree).elpd  # doctest: +SKIP
    """
    if draws.model != fit.model or draws.names != fit.spec.names:
        raise SettingError(
            f"the draws are of {draws.model} and the fit is of {fit.model}; give those of the fit"
        )
    own_tests, noise = as_tests(tests), noise_model(draws.noise_model)
    target, start = target_of(fit, own_tests, noise, tempering=draws.temper, priors=priors, threads=threads)
    n_walkers, n_kept = draws.densities.shape
    stride = -(-n_kept * n_walkers // max(most_draws, n_walkers))
    kept = replace(
        draws,
        chains=draws.chains[:, ::stride],
        noise_chains=draws.noise_chains[:, ::stride],
        densities=draws.densities[:, ::stride],
    )
    theta = np.asarray(target.form.from_model(kept.theta))
    stream = np.random.default_rng(rng)
    names = [test.name for test in own_tests]
    # Names that are there already have their number.
    labels = [name if name not in names[:at] else f"{name} ({at + 1})" for at, name in enumerate(names)]
    tree = kept.as_datatree()
    tree["sample_stats"]["lp"].attrs |= {"units": "1", "long_name": "log posterior, up to a constant"}
    groups = {
        "log_likelihood": _log_likelihood(target, theta, start, kept, labels, pointwise),
        "prior": _prior(target, kept, stream),
        "observed_data": NamedArrays(
            title="Measured force of the samples that are compared",
            rows=(),
            labels=_times(own_tests),
            arrays={
                label: NamedArray.of(test.force[test.counted], axis, unit="N", long_name="measured force")
                for label, axis, test in zip(labels, _time_axes(own_tests), own_tests, strict=True)
            },
        ),
        "posterior_predictive": _predictive(target, theta, kept, own_tests, labels, stream),
    }
    for name, group in groups.items():
        tree[name] = type(tree)(dataset=group.to_xarray())
    return tree


def _log_likelihood(
    target: Target, theta: Floats, start: Floats, draws: Draws, labels: Sequence[str], pointwise: Pointwise
) -> NamedArrays:
    """Tempered log densities of blocks or samples of all tests, one after the other."""
    residuals = [residual[0] for residual, _, _ in target.residuals(start[None])]
    if pointwise == "blocks":
        blocks = [
            blocks_of(each.test, autocorrelation_time(residual))
            for each, residual in zip(target.objective.compared, residuals, strict=True)
        ]
    else:
        blocks = [tuple(slice(index, index + 1) for index in range(residual.size)) for residual in residuals]
    density = block_densities(target, theta, draws.noise, blocks)
    shape = draws.densities.shape
    axis = pointwise.removesuffix("s")
    times = [
        each.test.time[each.test.counted][block.start]
        for each, of_test in zip(target.objective.compared, blocks, strict=True)
        for block in of_test
    ]
    tests = [label for label, of_test in zip(labels, blocks, strict=True) for _ in of_test]
    return NamedArrays(
        title=f"Log density of each {axis}, times {draws.temper:g}",
        rows=("chain", "draw"),
        labels=_chain_labels(shape) | {axis: number_labels(len(tests))},
        arrays={
            "force": NamedArray.of(
                density.reshape(*shape, -1),
                *("chain", "draw", axis),
                unit="1",
                long_name=f"log density of the force of each {axis} in its deviations, times {draws.temper:g}",
            )
        },
        along={
            "test": NamedArray.of(tests, axis, long_name="test"),
            "start": NamedArray.of(times, axis, unit="s", long_name=f"first instant of the {axis}"),
        },
    )


def _predictive(
    target: Target,
    theta: Floats,
    draws: Draws,
    tests: Sequence[DamperTest],
    labels: Sequence[str],
    stream: np.random.Generator,
) -> NamedArrays:
    shape = draws.densities.shape
    forces = {}
    for label, axis, each, deviation, (_, force, _) in zip(
        labels,
        _time_axes(tests),
        target.objective.compared,
        target.deviations,
        target.residuals(theta),
        strict=True,
    ):
        noisy = (force + target.noise.draw(force, draws.noise, stream)) * deviation + each.measured.mean()
        forces[label] = NamedArray.of(
            noisy.reshape(*shape, -1),
            *("chain", "draw", axis),
            unit="N",
            long_name="force of the model with noise",
        )
    return NamedArrays(
        title="Predicted force of each draw",
        rows=("chain", "draw"),
        labels=_chain_labels(shape) | _times(tests),
        arrays=forces,
    )


def _prior(target: Target, draws: Draws, stream: np.random.Generator) -> NamedArrays:
    """As many draws from the prior, in one chain."""
    space = target.space
    values = prior_values(space, draws.log_posterior.size, stream)
    model = np.asarray(target.form.to_model(values[:, : space.n_params]))
    columns = np.concatenate([model, values[:, space.n_params :]], axis=1)
    return NamedArrays(
        title="Draws from the prior",
        rows=("chain", "draw"),
        labels=_chain_labels((1, len(values))),
        arrays={
            each.name: NamedArray.of(column[None], "chain", "draw", unit=each.unit)
            for each, column in zip(draws.summaries, columns.T, strict=True)
        },
    )


def prior_values(space: Space, count: int, stream: np.random.Generator) -> Floats:
    """Draws from the prior of a space, parameters and noise, shape (count, n_all).

    Parameters are independent but for a stiffness k and the k x0 of its free length, uniform over what bounds of both
    permit where no prior of x0 is given.
    """
    of_product = None if space.pair is None or space.priors[space.pair[1]] is not None else space.pair[1]
    drawn: list[Floats] = []
    for _ in range(_ROUNDS):
        unit = np.empty((2 * count, space.n_dim))
        for column, (prior, index) in enumerate(zip(space.priors, space.box.free, strict=True)):
            unit[:, column] = _unit_draws(space, prior, index, 2 * count, stream)
        position = unit
        if space.pair is not None:
            if of_product is None:
                # Drawn as x0 itself.
                position = np.asarray(space.position(space.box.theta_from_unit(unit)))
            else:
                position[:, of_product] = stream.uniform(-0.5, 0.5, 2 * count)
        values, inside = space.values(position)
        drawn.append(np.asarray(values)[np.asarray(inside)])
        if sum(map(len, drawn)) >= count:
            return np.concatenate(drawn)[:count]
    raise SettingError(
        "almost no draw from the prior is within the bounds; give wider bounds or another prior"
    )


def _unit_draws(
    space: Space, prior: Prior | None, index: int, count: int, stream: np.random.Generator
) -> Floats:
    """Draws of one parameter in the unit interval of its bounds, by the inverse of its tabulated distribution."""
    if prior is None:
        return stream.random(count)
    lower, upper = space.box.lower[index], space.box.upper[index]
    log = space.box.log[index]
    first, last = 0.0, 1.0
    for _ in range(_ZOOMS):
        unit = np.linspace(first, last, _GRID)
        value = lower * (upper / lower) ** unit if log else lower + (upper - lower) * unit
        density = np.asarray(prior.log_density(value)) + (np.log(value) if log else 0.0)
        # A narrow prior may lie between two points: the next table is of the cells about the mass.
        mass = np.flatnonzero(density > density.max() - _NEGLIGIBLE)
        first, last = unit[max(mass[0] - 1, 0)], unit[min(mass[-1] + 1, _GRID - 1)]
    share = np.exp(density - density.max())
    below = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]))])
    return np.interp(stream.random(count), below / below[-1], unit)


def _chain_labels(shape: tuple[int, ...]) -> dict[str, NamedArray]:
    return {"chain": number_labels(shape[0]), "draw": number_labels(shape[1])}


def _time_axes(tests: Sequence[DamperTest]) -> list[str]:
    return ["time"] if len(tests) == 1 else [f"time_{number}" for number in range(1, len(tests) + 1)]


def _times(tests: Sequence[DamperTest]) -> dict[str, NamedArray]:
    return {
        axis: NamedArray.of(test.time[test.counted], unit="s", long_name="time")
        for axis, test in zip(_time_axes(tests), tests, strict=True)
    }

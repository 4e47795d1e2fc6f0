"""Draws with what ArviZ computes from: densities of the data, predictions and the data themselves.

It stands apart from the draws and their file, because it simulates every draw again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from mrwork.base.arguments import Count, Seed, Threads, checked
from mrwork.base.labelled import NamedArray, NamedArrays
from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.identification.covariance import autocorrelation_time
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws
from mrwork.uncertainty.posterior.target import Target, in_chunks, target_of

if TYPE_CHECKING:
    from xarray import DataTree

Pointwise = Literal["blocks", "samples"]


@checked
def inference_data(
    draws: Draws,
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    pointwise: Pointwise = "samples",
    most_draws: Count = 1000,
    rng: Seed = 0,
    threads: Threads = 0,
) -> DataTree:
    """Draws as a `DataTree` for ArviZ, with units of every variable, after simulating them again.

    The groups are `posterior`, `sample_stats`, `log_likelihood`, `posterior_predictive` and `observed_data`.
    `arviz_stats.loo` takes the tree as it is.

    `log_likelihood` has the one variable `force`. Its entries are densities under the noise model of the draws, in
    deviations of each test's force, times `temper`, as they were sampled: where residuals are correlated, the sum over
    all samples counts for as many as are effective. Leave-one-out over single samples takes these as independent given
    the parameters, also under "iid" noise. Residuals of real tests are not: its elpd tells interpolation between
    neighbours, and is too good, with too small an error. Under "ar1" noise each density is given the earlier residual,
    and is of the next sample. Densities of "blocks" are of whole cycles, longer than the autocorrelation time of the
    residuals at the fit, which are nearly independent; a record has few, and ArviZ then warns of heavy tails.
    `choose_model` compares models by tests that are left out.

    `posterior_predictive` has the recorded force with noise [N], of the samples that are compared. As in `sample`,
    every test has its own deviation; the weights of tests in the search do not enter.

    Parameters
    ----------
    draws
        Draws of `sample`.
    fit, tests
        The fit and the tests that were sampled.
    pointwise
        Whether densities are of blocks or of single samples.
    most_draws
        Largest number of draws, of which evenly spaced ones are kept, of every walker.
    rng
        Seed of the noise of the predictions.
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
            f"the draws are of {draws.model} and the fit is of {fit.model}; give the draws of the fit"
        )
    noise = noise_model(draws.noise_model)
    target, start = target_of(fit, as_tests(tests), noise, tempering=draws.temper, threads=threads)
    # As the fit observes them: a moving average leaves out the ends of a record.
    own_tests = target.objective.tests
    n_walkers, n_kept = draws.densities.shape
    stride = -(-n_kept * n_walkers // max(most_draws, n_walkers))
    thinned = replace(
        draws,
        chains=draws.chains[:, ::stride],
        noise_chains=draws.noise_chains[:, ::stride],
        densities=draws.densities[:, ::stride],
    )
    theta = np.asarray(target.form.from_model(thinned.theta))
    stream = np.random.default_rng(rng)
    names = [test.name for test in own_tests]
    # Names that are there already have their number.
    labels = [name if name not in names[:at] else f"{name} ({at + 1})" for at, name in enumerate(names)]
    tree = thinned.as_datatree()
    tree["sample_stats"]["lp"].attrs |= {"units": "1", "long_name": "log posterior, up to a constant"}
    groups = {
        "log_likelihood": _log_likelihood(target, theta, start, thinned, labels, pointwise),
        "observed_data": NamedArrays(
            title="Measured force of the samples that are compared",
            rows=(),
            labels=_times(own_tests),
            arrays={
                label: NamedArray.of(test.force[test.counted], axis, unit="N", long_name="measured force")
                for label, axis, test in zip(labels, _time_axes(own_tests), own_tests, strict=True)
            },
        ),
        "posterior_predictive": _predictive(target, theta, thinned, own_tests, labels, stream),
    }
    for name, group in groups.items():
        tree[name] = type(tree)(dataset=group.to_xarray())
    return tree


def _log_likelihood(
    target: Target, theta: Floats, start: Floats, draws: Draws, labels: Sequence[str], pointwise: Pointwise
) -> NamedArrays:
    """Tempered log densities of blocks or samples of all tests, one after the other."""
    residuals = [residual[0] for residual, _ in target.residuals(start[None])]
    if pointwise == "blocks":
        blocks = [
            _blocks_of(test.test, autocorrelation_time(residual))
            for test, residual in zip(target.objective.compared, residuals, strict=True)
        ]
    else:
        blocks = [tuple(slice(index, index + 1) for index in range(residual.size)) for residual in residuals]
    density = _block_densities(target, theta, draws.noise, blocks)
    shape = draws.densities.shape
    axis = pointwise.removesuffix("s")
    times = [
        test.test.time[test.test.counted][block.start]
        for test, of_test in zip(target.objective.compared, blocks, strict=True)
        for block in of_test
    ]
    tests = [label for label, of_test in zip(labels, blocks, strict=True) for _ in of_test]
    return NamedArrays(
        title=f"Log density of each {axis}, times {draws.temper:g}",
        rows=("chain", "draw"),
        labels=_chain_labels(shape) | {axis: NamedArray.of(range(len(tests)))},
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


def _block_densities(
    target: Target, theta: Floats, noise: Floats, blocks: Sequence[Sequence[slice]]
) -> Floats:
    """Tempered log density of the blocks of all tests, (n_draws, n_blocks), under draws in the target's form."""

    def of_rows(theta: Floats, noise: Floats) -> Floats:
        columns = []
        for (residual, failed), of_test in zip(target.residuals(theta), blocks, strict=True):
            density = target.temper * target.noise.log_densities(residual, noise)
            density[failed] = -np.inf
            columns += [density[:, block].sum(axis=1) for block in of_test]
        return np.stack(columns, axis=1)

    return in_chunks(of_rows, theta, noise)


def _blocks_of(test: DamperTest, least: float) -> tuple[slice, ...]:
    """Adjacent blocks of whole cycles, of at least `least` counted samples; the ends belong to the outer blocks."""
    displacement = test.displacement[test.counted]
    cycles = whole_cycles(displacement)
    edges = [cycle.start for cycle in cycles[1:]]
    end = cycles[-1].stop if cycles else displacement.size
    cuts = [0]
    for edge in edges:
        if edge - cuts[-1] >= least and end - edge >= least:
            cuts.append(edge)
    return tuple(slice(first, last) for first, last in zip(cuts, [*cuts[1:], displacement.size], strict=True))


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
    for label, axis, test, deviation, (residual, _) in zip(
        labels,
        _time_axes(tests),
        target.objective.compared,
        target.deviations,
        target.residuals(theta),
        strict=True,
    ):
        noise = target.noise.draw(test.measured.size, draws.noise, stream)
        noisy = test.measured + (residual + noise) * deviation
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


def _chain_labels(shape: tuple[int, ...]) -> dict[str, NamedArray]:
    return {"chain": NamedArray.of(range(shape[0])), "draw": NamedArray.of(range(shape[1]))}


def _time_axes(tests: Sequence[DamperTest]) -> list[str]:
    return ["time"] if len(tests) == 1 else [f"time_{number}" for number in range(1, len(tests) + 1)]


def _times(tests: Sequence[DamperTest]) -> dict[str, NamedArray]:
    return {
        axis: NamedArray.of(test.time[test.counted], unit="s", long_name="time")
        for axis, test in zip(_time_axes(tests), tests, strict=True)
    }

"""Draws with what ArviZ computes from: densities of the data, predictions and the data themselves.

It stands apart from the draws and their file, because it simulates every draw again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
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
from mrwork.uncertainty.posterior.target import Target

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
    if draws.model != fit.model or draws.names != tuple(estimate.name for estimate in fit.varied):
        raise SettingError(
            f"the draws are of {draws.model} and the fit is of {fit.model}; give the draws of the fit"
        )
    noise = noise_model(draws.noise_model)
    target = Target.of_fit(fit, as_tests(tests), noise, tempering=draws.temper, threads=threads)
    n_walkers, n_kept = draws.densities.shape
    stride = -(-n_kept * n_walkers // max(most_draws, n_walkers))
    thinned = replace(
        draws,
        chains=draws.chains[:, ::stride],
        noise_chains=draws.noise_chains[:, ::stride],
        densities=draws.densities[:, ::stride],
    )
    theta = np.asarray(target.form.from_model(thinned.with_effects))
    stream = np.random.default_rng(rng)
    names = [test.name for test in target.objective.tests]
    # Names that are there already have their number.
    labels = [
        name if name not in names[:index] else f"{name} ({index + 1})" for index, name in enumerate(names)
    ]
    tree = thinned.as_datatree()
    tree["sample_stats"]["lp"].attrs |= {"units": "1", "long_name": "log posterior, up to a constant"}
    shape, axis = thinned.densities.shape, pointwise.removesuffix("s")
    chains = {"chain": NamedArray.of(range(shape[0])), "draw": NamedArray.of(range(shape[1]))}
    densities, test_of, starts = list[Floats](), list[str](), list[float]()
    times, measured, predicted = (dict[str, NamedArray]() for _ in range(3))
    for number, (label, test, deviation, (residual, failed), (at_fit, _)) in enumerate(
        zip(
            labels,
            target.objective.compared,
            target.deviations,
            target.residuals(theta),
            target.residuals(target.start[None]),
            strict=True,
        ),
        start=1,
    ):
        time = test.test.time[test.counted]
        density = target.temper * noise.log_densities(residual, thinned.noise)
        density[failed] = -np.inf
        firsts: Sequence[int] = range(time.size)
        if pointwise == "blocks":
            firsts = _starts_of_blocks(test.test, autocorrelation_time(at_fit[0]))
            blocks = pairwise([*firsts, time.size])
            density = np.stack([density[:, first:last].sum(axis=1) for first, last in blocks], axis=1)
        densities.append(density)
        test_of += [label] * len(firsts)
        starts += time[firsts].tolist()
        noisy = residual + noise.draw(time.size, thinned.noise, stream)
        force = (test.measured + noisy * deviation).reshape(*shape, -1)
        time_axis = "time" if len(names) == 1 else f"time_{number}"
        times[time_axis] = NamedArray.of(time, unit="s", long_name="time")
        measured[label] = NamedArray.of(test.measured, time_axis, unit="N", long_name="measured force")
        predicted[label] = NamedArray.of(
            force, *chains, time_axis, unit="N", long_name="force of the model with noise"
        )
    words = f"log density of the force of each {axis} in its deviations, times {draws.temper:g}"
    density = np.concatenate(densities, axis=1).reshape(*shape, -1)
    groups = {
        "log_likelihood": NamedArrays(
            title=f"Log density of each {axis}, times {draws.temper:g}",
            rows=(*chains,),
            labels=chains | {axis: NamedArray.of(range(len(test_of)))},
            arrays={"force": NamedArray.of(density, *chains, axis, unit="1", long_name=words)},
            along={
                "test": NamedArray.of(test_of, axis, long_name="test"),
                "start": NamedArray.of(starts, axis, unit="s", long_name=f"first instant of the {axis}"),
            },
        ),
        "observed_data": NamedArrays(
            title="Measured force of the samples that are compared", rows=(), labels=times, arrays=measured
        ),
        "posterior_predictive": NamedArrays(
            title="Predicted force of each draw", rows=(*chains,), labels=chains | times, arrays=predicted
        ),
    }
    for name, group in groups.items():
        tree[name] = type(tree)(dataset=group.to_xarray())
    return tree


def _starts_of_blocks(test: DamperTest, least: float) -> list[int]:
    """First samples of adjacent blocks of whole cycles, of at least `least`; the ends belong to the outer blocks."""
    displacement = test.displacement[test.counted]
    cycles = whole_cycles(displacement)
    end = cycles[-1].stop if cycles else displacement.size
    starts = [0]
    for cycle in cycles[1:]:
        if cycle.start - starts[-1] >= least and end - cycle.start >= least:
            starts.append(cycle.start)
    return starts

"""Sample the posterior of an identified damper: the whole ensemble simulated in lanes, until it has told enough."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.uncertainty.posterior.chain_file import ChainFile
from mrwork.uncertainty.posterior.diagnosis import Diagnosis, next_check
from mrwork.uncertainty.posterior.draws import Draws
from mrwork.uncertainty.posterior.ensemble import Ensemble
from mrwork.uncertainty.posterior.prepare import prepared
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.sampling import Sampling
from mrwork.uncertainty.posterior.target import Tempering
from mrwork.uncertainty.posterior.walkers import first_walkers

# Seconds between two calls of who watches, and between two times that the chain is written.
_TELL = 0.2
_WRITE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingProgress:
    """Where a sampling stands: steps done of at most so many, steps a second, and the latest diagnosis, if any."""

    steps: int
    most_steps: int
    seconds: float
    steps_per_second: float
    diagnosis: Diagnosis | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainSoFar:
    """A chain of `n_steps` that was interrupted; its draws take a while and are made when they are asked for."""

    n_steps: int
    draws: Callable[[], Draws]


def sample_posterior(
    spec: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    *,
    start: Fit,
    noise: str = "iid",
    priors: Mapping[str, Prior] | None = None,
    tempering: Tempering | None = None,
    walkers: int = 64,
    most_steps: int = 20_000,
    rng: int = 0,
    threads: int = 0,
    store: str | Path | None = None,
    resume: bool = False,
    on_progress: Callable[[SamplingProgress], None] | None = None,
) -> Draws:
    """Draw from the posterior of a damper's parameters and of the noise, from an ensemble of walkers about a fit.

    The ensemble stops by itself: when the chain is 50 autocorrelation times long, the rank-normalised R-hat of every
    parameter is below 1.01, and there are at least 400 effective draws of its bulk and of its tails; a quarter of the
    chain is left out as burn-in. Bounds, nuisance parameters and observation models are those of the fit.

    Parameters
    ----------
    spec
        The model of the fit, or its name. A Spencer form is sampled in its normalised one, and mapped back.
    tests
        The tests of the fit, or others of the same damper.
    start
        Where walkers start about; its bounds are the box of the prior.
    noise
        How the measured force scatters about the model's: one of `mrwork.uncertainty.noise.NOISES`.
    priors
        By name of a parameter of the form that is sampled, `noise.sigma` and so on for the noise. Others are spread
        evenly over the box, on the parameter's own scale; of a stiffness k and its free length x0, the product is.
    tempering
        What the log-likelihood is multiplied by, so that correlated residuals are not counted as independent ones: a
        number, or "effective", the share of independent residuals at the start. Default "effective" for "iid",
        "student_t" and "amplitude", 1 for noise that knows of correlation; see `Target.of`.
    walkers
        An even number, at least twice the number of parameters with those of the noise.
    most_steps
        Steps after which the ensemble stops in any case; the verdict then says what is missing.
    rng
        Seed. The same seed gives the same bits on any number of threads.
    threads
        Threads of the simulation, 0 for all.
    store
        HDF5 file that the chain is written to as it grows.
    resume
        Go on from the chain in `store`, with the same stream: to the same bits as if nothing had happened.
    on_progress
        Called about five times a second.

    Returns
    -------
    Draws
        Draws of parameters and noise, diagnostics, verdict, provenance.

    Raises
    ------
    SettingError
        Where a setting, a prior or the start is impossible.
    UnknownNameError
        Where there is no such noise model, or a prior is of what there is not.
    JournalError
        Where `store` cannot be resumed; the message says why.
    OutputError
        Where it cannot be written.
    Interrupted
        On Ctrl-C, carrying a `ChainSoFar`, which is in `store` too.

    Examples
    --------
    >>> import mrwork as mr
    >>> test = mr.synthetic_test("spencer1997")
    >>> fit = mr.identify("normalised_bouc_wen", test)  # doctest: +SKIP
    >>> draws = mr.sample_posterior("normalised_bouc_wen", test, start=fit)  # doctest: +SKIP
    >>> print(draws.verdict)  # doctest: +SKIP
    """
    began = time.perf_counter()
    spec = damper(spec) if isinstance(spec, str) else spec
    tests = (tests,) if isinstance(tests, DamperTest) else tuple(tests)
    sampling = prepared(
        spec,
        tests,
        start,
        noise=noise,
        priors=dict(priors or {}),
        tempering=tempering,
        walkers=walkers,
        rng=rng,
        threads=threads,
    )
    if most_steps < 1:
        raise SettingError(f"`most_steps` is {most_steps}; give 1 or more")
    if resume and store is None:
        raise SettingError("`resume` needs the `store` to go on from; name its file")
    file: ChainFile | None = None
    if resume and store is not None:
        file, ensemble = ChainFile.resume(Path(store), sampling.premises(), sampling.target)
    else:
        origins = first_walkers(sampling.target, sampling.start, walkers, np.random.default_rng(rng))
        ensemble = Ensemble.begin(sampling.target, origins, rng)
        if store is not None:
            file = ChainFile.begin(Path(store), sampling.premises(), ensemble)
    watch = _Watch(most_steps=most_steps, began=began, first=ensemble.n_steps, tell=on_progress, file=file)
    try:
        diagnosis = _run(sampling, ensemble, watch)
    except KeyboardInterrupt as interrupt:
        if file is not None:
            file.append(ensemble)
        if ensemble.n_steps == 0:
            raise
        seconds = time.perf_counter() - began
        so_far = ChainSoFar(
            n_steps=ensemble.n_steps,
            draws=lambda: sampling.draws(
                ensemble, sampling.diagnosis(ensemble), seconds=seconds, interrupted=True
            ),
        )
        raise Interrupted(so_far, "sampling") from interrupt
    return sampling.draws(ensemble, diagnosis, seconds=time.perf_counter() - began)


def _run(sampling: Sampling, ensemble: Ensemble, watch: _Watch) -> Diagnosis:
    """Advance until the ensemble has told enough, or may no more; the steps of a check depend on nothing else."""
    while True:
        done = ensemble.n_steps
        if done and (done >= watch.most_steps or done == next_check(done - 1)):
            diagnosis = watch.diagnosis = sampling.diagnosis(ensemble)
            if done >= watch.most_steps or not diagnosis.shortcomings:
                if watch.file is not None:
                    watch.file.append(ensemble)
                return diagnosis
        until = min(next_check(done), watch.most_steps)
        ensemble.advance(until, lambda steps: watch.look(steps, ensemble))


@dataclass(slots=True, kw_only=True)
class _Watch:
    """Tells who watches, and writes the chain, every so often."""

    most_steps: int
    began: float
    first: int
    tell: Callable[[SamplingProgress], None] | None
    file: ChainFile | None
    diagnosis: Diagnosis | None = None
    told: float = 0.0
    wrote: float = 0.0

    def look(self, steps: int, ensemble: Ensemble) -> None:
        seconds = time.perf_counter() - self.began
        if self.file is not None and seconds - self.wrote >= _WRITE:
            self.file.append(ensemble)
            self.wrote = seconds
        if self.tell is not None and seconds - self.told >= _TELL:
            self.told = seconds
            self.tell(
                SamplingProgress(
                    steps=steps,
                    most_steps=self.most_steps,
                    seconds=seconds,
                    steps_per_second=(steps - self.first) / seconds,
                    diagnosis=self.diagnosis,
                )
            )

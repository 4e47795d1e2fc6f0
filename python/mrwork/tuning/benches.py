"""The benches of a tuning, training and test motions, nominal and with realisations; judgements of candidates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.store import Journal, digest_of
from mrwork.study.batches import RunCriteria, simulated_criteria
from mrwork.study.run import runs_of
from mrwork.study.run_result import DeviceDemand, demands_of
from mrwork.study.study import Realisations, Study, nominal
from mrwork.summary import Summarised
from mrwork.tuning.objective import Objective
from mrwork.tuning.problem import Bench, Clock, check_controllable
from mrwork.tuning.results import Judgement, Varied, judged
from mrwork.tuning.space import Candidate


class Shaped(Protocol):
    """A result with one number for each of its inputs."""

    @property
    def shape(self) -> tuple[int, ...]:
        """How many there are along each axis."""


T = TypeVar("T", bound=Shaped)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Benches(Summarised):
    """Benches with the training and the test motions; the varied ones have the realisations of the study, if any."""

    training: Bench
    testing: Bench | None
    training_varied: Bench | None
    testing_varied: Bench | None
    journal: Journal | None

    def searched(self, *, robust: bool) -> Bench:
        """The bench on which candidates are scored."""
        return self.training_varied if robust and self.training_varied is not None else self.training

    def tested(self, *, robust: bool) -> Bench | None:
        """The bench with the test motions on which points of a front are judged."""
        return self.testing_varied if robust and self.testing_varied is not None else self.testing

    def with_constant(self, constant: Candidate) -> Benches:
        """With the criteria under the best constant command, a baseline of objectives."""

        def beside(name: str, bench: Bench) -> Bench:
            found = recorded(
                self.journal,
                "baseline",
                digest_of(name, constant),
                RunCriteria,
                bench.shape_of(1),
                lambda: bench.run("passive", [constant]),
            )
            return replace(bench, constant=found)

        def beside_if(name: str, bench: Bench | None) -> Bench | None:
            return None if bench is None else beside(name, bench)

        return replace(
            self,
            training=beside("training", self.training),
            testing=beside_if("testing", self.testing),
            training_varied=beside_if("training_varied", self.training_varied),
            testing_varied=beside_if("testing_varied", self.testing_varied),
        )

    def judgements(
        self, law: str, candidate: Candidate, objective: Objective, *, robust: bool
    ) -> tuple[Judgement, Judgement | None]:
        """A candidate on the training and on the test motions; bands are of the test motions, if there are any."""
        wide = self.training_varied if robust or self.testing is None else None
        train = self._judged(self.training, wide, law, candidate, objective, robust)
        if self.testing is None:
            return train, None
        return train, self._judged(self.testing, self.testing_varied, law, candidate, objective, robust)

    def demands(
        self, law: str, candidate: Candidate, label: str
    ) -> dict[tuple[str, str], tuple[DeviceDemand, ...]]:
        """Demand of a law on each damper under every motion of the study, by label and motion; none without a law."""
        bench = self.training
        try:
            arrangement = bench.arrangement_with(law, candidate, label)
        except SettingError:
            return {}
        runs = runs_of(bench.study, arrangement, self.journal, bench.threads)
        motions = bench.study.motions
        return {
            (label, motions[number].name): demands_of(
                run, arrangement.devices, motions[number].ground.duration
            )
            for number, run in runs
        }

    def _judged(
        self,
        bench: Bench,
        wide: Bench | None,
        law: str,
        candidate: Candidate,
        objective: Objective,
        robust: bool,
    ) -> Judgement:
        def on(each: Bench) -> RunCriteria:
            inputs = digest_of(
                law, candidate, [motion.name for motion in each.motions], len(each.realisations)
            )
            return recorded(
                self.journal,
                "judgement",
                inputs,
                RunCriteria,
                each.shape_of(1),
                lambda: each.run(law, [candidate]),
            )

        found = on(bench)
        varied = None if wide is None else Varied(bench=wide, found=on(wide))
        return judged(bench, objective, found, varied, robust=robust)


def recorded(
    journal: Journal | None,
    step: str,
    inputs: str,
    kind: type[T],
    shape: tuple[int, ...],
    compute: Callable[[], T],
) -> T:
    """A step of this shape from the journal, or computed; without a journal always computed."""
    if journal is None:
        return compute()
    return journal.once(step, inputs, kind, compute, agrees=lambda found: found.shape == shape)


def benches_of(
    study: Study, *, journal: Journal | None, threads: int, clock: Clock, robust: bool = True
) -> Benches:
    """The benches of a study; the dampers at i = 0 are simulated on each.

    Unless a table is `robust`, training motions have no realisations where there are test motions.
    """
    check_controllable(study)
    problem = study.problem
    assert problem is not None
    training = study.chosen_on
    testing = tuple(each.ground for each in study.motions if each.use == "test")
    separate = any(each.use == "training" for each in study.motions)
    one = nominal(study.devices)

    def bench(motions: Sequence[GroundMotion], realisations: Realisations) -> Bench:
        arrangement = next(each for each in study.arrangements if each.row.kind == "passive_off")

        def passive() -> RunCriteria:
            assert arrangement.law is not None
            found = simulated_criteria(
                arrangement,
                arrangement.law,
                motions,
                study.hardware,
                realisations,
                bare=study.building,
                threads=threads,
            )
            clock.simulating += found.seconds
            return found

        inputs = digest_of([motion.name for motion in motions], len(realisations))
        return Bench(
            study=study,
            arrangement=arrangement,
            problem=problem,
            motions=tuple(motions),
            realisations=realisations,
            passive=recorded(
                journal, "passive", inputs, RunCriteria, (1, len(motions), len(realisations)), passive
            ),
            threads=threads,
            clock=clock,
        )

    wide = study.realisations
    return Benches(
        training=bench(training, one),
        testing=bench(testing, one) if separate else None,
        training_varied=None if wide is None or (separate and not robust) else bench(training, wide),
        testing_varied=bench(testing, wide) if separate and wide is not None else None,
        journal=journal,
    )

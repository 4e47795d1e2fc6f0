"""A control law in Python for rows of runs: a function of what is measured, beside the laws of the registry.

The loop itself is the same for every law. A function that is recorded runs as one of the registry does. One that cannot
be is asked at each sample, some tens of microseconds: a run of the five-storey frame at 1 ms takes ten to twenty times
as long. Candidates in one batch share the waiting. What a function raises has file and line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Positive, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.closed_loop.loop_sample import READINGS, LoopSample
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.laws.own_formula import OwnFormula

MOST_MEMORY = 1_000_000
"""Most numbers that a run may keep from sample to sample."""
Command = Callable[[LoopSample, Floats], ArrayLike]
"""A law in Python: takes what is measured and the memory of each run, and returns the commands."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class UserLaw(Summarised):
    """A control law in Python, for `simulate_loop`, beside those of the registry, see `control_laws`.

    Parameters
    ----------
    name
        Name in messages.
    command
        Takes a `LoopSample` and the memory, and returns the command of each run and device, shape (n_runs, n_devices),
        or (n_runs,) for one device. The command of an actuator is a force of either sign that resists its lengthening
        [N]. The loop limits it to the range of the device, delays and holds it. It is called
        with several runs at once: candidates, motions, draws. A command that is not a number is an error. Where a
        reading that it looks at is not one, its run has no command at that sample, and ends as `failed_safe`. The
        working directory, stdout and stderr are after each call what they were before.
    n_candidates
        Number of candidates, which differ by `LoopSample.candidate`.
    n_memory
        Numbers that each run keeps from sample to sample: the second argument, shape (n_runs, n_memory), zero at the
        start and changed in place. A law must keep nothing elsewhere, since a run is repeated with a shorter step where
        a damper requires it.
    rms_time
        Time constant of the running root mean squares that the loop keeps for each run, `LoopSample.rms` [s].
    record
        Whether it is recorded as operations of the core and then runs as a law of the registry: by default where that
        can be done, and a remark of the responses says why it cannot. `False` calls the function at every sample, as to
        print what it does; `True` refuses one that cannot be recorded.
    source
        Digest of the text that `command` is from, by which a journal tells laws apart.

    Raises
    ------
    SettingError
        If a number is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> gains = np.array([1.0, 10.0, 100.0])
    >>> def proportional(sample, memory):
    ...     return gains[sample.candidate, None] * np.abs(sample.rate)
    >>> law = mr.closed_loop.UserLaw(name="proportional", command=proportional, n_candidates=3)
    >>> mr.simulate_loop(frame, [damper], law, [mr.synthetic_motion(duration=2.0)]).shape
    (3, 1, 1)
    """

    _made_by: ClassVar[str] = "mr.closed_loop.UserLaw(name=..., command=...)"
    readings: ClassVar[tuple[str, ...]] = tuple(READINGS)

    name: str
    command: Command
    n_candidates: Annotated[int, Within(least=1, most=1_000_000)] = 1
    n_memory: Annotated[int, Within(least=0, most=MOST_MEMORY)] = 0
    rms_time: Positive | None = None
    record: bool | None = None
    source: str = ""

    @property
    def formula(self) -> OwnFormula:
        """The law as the loop takes it."""
        return OwnFormula(
            name=self.name,
            function=self.command,
            rows=lambda command: lambda sample, memory, _: command(sample, memory),
            start=np.zeros(self.n_memory),
            rms_time=self.rms_time,
            record=self.record,
        )

    @checked
    def placeholder(self, devices: Sequence[Device]) -> ControlLaw:
        """The law that the core has in place of this one: its candidates, without a command."""
        return ControlLaw(name="passive", gains={"command": np.zeros((self.n_candidates, len(devices)))})

    def _summary(self) -> Summary:
        return Summary(
            title=f"Control law {self.name}, in Python",
            facts=(
                ("candidates", str(self.n_candidates)),
                ("memory", f"{self.n_memory} numbers for each run"),
            ),
            notes=(
                ()
                if self.record
                else ("Where it cannot be recorded, the loop waits for Python at every control sample.",)
            ),
        )

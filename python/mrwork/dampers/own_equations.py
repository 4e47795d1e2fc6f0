"""Equations of a damper of the user: formulas on tapes, which are data, and the text of its functions for readers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from mrwork import _rust
from mrwork.base.tape import Tape
from mrwork.dampers.parameters import ParamSpec
from mrwork.errors import SettingError
from mrwork.store.codec import digest_of


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnEquations:
    """Formulas that the core walks, and the Python that they were recorded from, see `mrwork.own_damper`.

    Inputs of each are the parameters, the states, displacement [m] and velocity [m/s]. Without states `rate` and
    `relaxation` are `None`; with them `relaxation` is what the user gives, or the spectral radius of the rate in the
    states.
    """

    force: Tape
    rate: Tape | None = None
    relaxation: Tape | None = None
    source: str = field(default="", compare=False)

    @property
    def digest(self) -> str:
        """Digest of the formulas, which tells the damper from others of the same name."""
        return digest_of(self.force, self.rate, self.relaxation)

    def core_name(self, parameters: Sequence[ParamSpec], n_states: int) -> str:
        """The name by which the core knows the damper in this process.

        Raises
        ------
        SettingError
            If a tape is damaged, or has operations that this version does not have.
        """
        return _registered(self, tuple(parameters), n_states)


@lru_cache(maxsize=256)
def _registered(own: OwnEquations, parameters: tuple[ParamSpec, ...], n_states: int) -> str:
    ranges = [(each.name, each.unit, each.scale, each.lower, each.upper) for each in parameters]
    name = f"own:{digest_of(own.digest, ranges, n_states)}"
    n_inputs = len(parameters) + 2
    none = Tape(entries=(), constants=(), table=(), ends=(), n_inputs=n_inputs, n_slots=n_inputs)
    try:
        _rust.register_damper(
            name, list(parameters), n_states, own.force, own.rate or none, own.relaxation or none
        )
    except (ValueError, OverflowError, TypeError) as error:
        raise SettingError(f"the formulas of a damper of the user cannot be taken: {error}") from None
    return name

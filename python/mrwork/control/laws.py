"""Control laws as the Rust core declares them, and a law with its gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, UnknownNameError
from mrwork.summary import Summarised, Summary, rounded

Floats = NDArray[np.float64]
Shape = Literal["device", "state"]


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSpec:
    """A gain of a law: one number for each device, or one for each device and state [q; q']."""

    name: str
    unit: str
    shape: Shape
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlLawSpec:
    """A law: its formula, source, gains and tables.

    `tables` are arrays that all candidates share. A law that `needs_curve` evaluates the damper force as a function of
    the command, by a static hysteretic model of the damper. A law that `commands_force` drives ideal actuators.
    """

    name: str
    title: str
    equation: str
    description: str
    source: str
    gains: tuple[GainSpec, ...]
    tables: tuple[str, ...]
    needs_curve: bool
    commands_force: bool


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ControlLaw(Summarised):
    """A law with its gains, for one or several candidates.

    Parameters
    ----------
    name
        Name of the law; see `control_laws`.
    gains
        By name, shape (n_devices,) or (n_devices, 2n), with an optional leading axis for candidates.
    tables
        By name, shape (n,).
    curve
        Model of the damper in the law: static hysteretic with current laws, and its parameters.
    """

    name: str
    gains: Mapping[str, ArrayLike] = field(default_factory=dict)
    tables: Mapping[str, ArrayLike] = field(default_factory=dict)
    curve: tuple[DamperSpec, ArrayLike] | None = None

    @property
    def spec(self) -> ControlLawSpec:
        """The declaration of the law."""
        return control_law(self.name)

    def gain_rows(self, n_devices: int, n_states: int) -> Floats:
        """The gains as rows, shape (n_candidates, n_gains).

        Raises
        ------
        SettingError
            If a gain is missing, unknown, or of the wrong shape.
        """
        spec = self.spec
        _check_names(f"the gains of {spec.name}", self.gains, [gain.name for gain in spec.gains])
        blocks = []
        for gain in spec.gains:
            shape = (n_devices,) if gain.shape == "device" else (n_devices, n_states)
            given = np.asarray(self.gains[gain.name], dtype=np.float64)
            if given.shape[-len(shape) :] != shape or given.ndim > len(shape) + 1:
                raise SettingError(
                    f"`{gain.name}` of {spec.name} has shape {given.shape}; give {shape}, "
                    f"or a row of that shape for each candidate"
                )
            blocks.append(given.reshape(-1, int(np.prod(shape))))
        n_candidates = max((len(block) for block in blocks), default=1)
        if any(len(block) not in (1, n_candidates) for block in blocks):
            counts = ", ".join(str(len(block)) for block in blocks)
            raise SettingError(
                f"the gains of {spec.name} have {counts} candidates; give the same number for each gain, or one"
            )
        wide = [np.broadcast_to(block, (n_candidates, block.shape[1])) for block in blocks]
        return np.ascontiguousarray(np.hstack(wide)) if wide else np.zeros((1, 0))

    def table_rows(self) -> list[Floats]:
        """The tables in order.

        Raises
        ------
        SettingError
            If one is missing or unknown.
        """
        _check_names(f"the tables of {self.name}", self.tables, list(self.spec.tables))
        return [
            np.ascontiguousarray(np.ravel(np.asarray(self.tables[name], dtype=np.float64)))
            for name in self.spec.tables
        ]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Control law {self.spec.title}",
            facts=(("equation", self.spec.equation), ("source", self.spec.source)),
            columns=("number", "shape", "largest"),
            rows=[
                (
                    name,
                    str(np.shape(value)),
                    rounded(float(np.abs(np.asarray(value, dtype=np.float64)).max())),
                )
                for name, value in (*self.gains.items(), *self.tables.items())
            ],
        )


@cache
def control_laws() -> tuple[ControlLawSpec, ...]:
    """Every control law, in the order of the registry."""
    return tuple(
        ControlLawSpec(
            **{**entry, "tables": tuple(entry["tables"])}
            | {"gains": tuple(GainSpec(**gain) for gain in entry["gains"])},
        )
        for entry in _rust.control_laws()
    )


def control_law(name: str) -> ControlLawSpec:
    """The law of that name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    for spec in control_laws():
        if spec.name == name:
            return spec
    known = ", ".join(spec.name for spec in control_laws())
    raise UnknownNameError(f"no control law is called {name!r}; there are {known}")


def _check_names(what: str, given: Mapping[str, ArrayLike], expected: list[str]) -> None:
    if set(given) != set(expected):
        raise SettingError(f"{what} are {', '.join(given) or 'none'}; give {', '.join(expected) or 'none'}")

"""Linear systems of first order, and their exchange with python-control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError, UnknownNameError

if TYPE_CHECKING:
    from control import StateSpace

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSystem:
    """`s' = A s + B u`, `y = C s + D u`, in continuous time. The arrays are kept as read-only copies.

    Parameters
    ----------
    A, B, C, D
        Shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs).
    input_names, output_names
        By default "input 1", "output 1" and so on.

    Raises
    ------
    SettingError
        Where shapes disagree or a number is not finite.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for title in ("A", "B", "C", "D"):
            kept = np.array(getattr(self, title), dtype=np.float64, order="C")
            kept.setflags(write=False)
            object.__setattr__(self, title, kept)
            if kept.ndim != 2 or not np.isfinite(kept).all():
                raise SettingError(f"linear system: {title} must be a matrix of finite numbers")
        n, n_inputs, n_outputs = len(self.A), self.B.shape[1], len(self.C)
        for title, matrix, shape in (
            ("A", self.A, (n, n)),
            ("B", self.B, (n, n_inputs)),
            ("C", self.C, (n_outputs, n)),
            ("D", self.D, (n_outputs, n_inputs)),
        ):
            if matrix.shape != shape:
                sides = " x ".join(str(side) for side in matrix.shape)
                raise SettingError(
                    f"linear system: {title} is {sides} where {shape[0]} x {shape[1]} was expected"
                )
        for field, noun, count in (("input_names", "input", n_inputs), ("output_names", "output", n_outputs)):
            names = tuple(getattr(self, field)) or tuple(f"{noun} {number}" for number in range(1, count + 1))
            if len(names) != count:
                raise SettingError(
                    f"linear system: {len(names)} {noun} names for {count} {noun}s; name each of them"
                )
            object.__setattr__(self, field, names)

    @property
    def n_states(self) -> int:
        """How many states s has."""
        return len(self.A)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [rad/s], shape (n,)."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    def frequency_response(self, frequency: Floats) -> NDArray[np.complex128]:
        """`C (i omega - A)^-1 B + D` at frequencies [Hz], shape (n_frequencies, n_outputs, n_inputs)."""
        s = 2j * np.pi * np.asarray(frequency, dtype=np.float64)[:, None, None]
        states = np.linalg.solve(s * np.eye(self.n_states) - self.A, self.B[None])
        return np.asarray(self.C @ states + self.D, dtype=np.complex128)

    def select(self, *, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> LinearSystem:
        """Return the system with some inputs and outputs only, by name and in that order; none means all.

        Raises
        ------
        UnknownNameError
            Where there is no such input or output.
        """
        columns = _places(inputs, self.input_names, "input")
        rows = _places(outputs, self.output_names, "output")
        return LinearSystem(
            A=self.A,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            input_names=tuple(self.input_names[column] for column in columns),
            output_names=tuple(self.output_names[row] for row in rows),
        )

    def to_control(self) -> StateSpace:
        """Return the same system as a StateSpace of python-control.

        Raises
        ------
        SettingError
            Where python-control is not installed.
        """
        try:
            from control import StateSpace
        except ImportError as error:
            raise SettingError(
                "exchanging systems with python-control needs it; run: pip install 'mrwork[control]'"
            ) from error
        # It keeps the point in names for itself.
        inputs, outputs = (
            [name.replace(".", ",") for name in names] for names in (self.input_names, self.output_names)
        )
        return StateSpace(self.A, self.B, self.C, self.D, inputs=inputs, outputs=outputs)


def from_control(system: StateSpace) -> LinearSystem:
    """Return a StateSpace of python-control as a linear system.

    Raises
    ------
    SettingError
        Where it runs in discrete time.
    """
    # None leaves open which time it runs in, and is what an old model often has.
    if system.dt not in (None, 0):
        raise SettingError(
            f"the system runs in discrete time with a step of {system.dt} s; give one in continuous time"
        )
    return LinearSystem(
        A=system.A,
        B=system.B,
        C=system.C,
        D=system.D,
        input_names=tuple(system.input_labels),
        output_names=tuple(system.output_labels),
    )


def _places(wanted: Sequence[str], names: tuple[str, ...], noun: str) -> list[int]:
    for name in wanted:
        if name not in names:
            raise UnknownNameError(f"there is no {noun} {name!r}; choose among {', '.join(names)}")
    return [names.index(name) for name in wanted or names]

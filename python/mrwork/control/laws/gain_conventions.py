"""What tells that a finished gain is meant otherwise: the loop of other signs and orders of its columns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.control.linear.margins import LoopMargins
from mrwork.control.linear.plant import Plant, hold_input, symmetric_part

# Coordinates times devices, or times four, up to which the loops of other readings are looked at, in a second.
_MOST_LOOPS = 400
# Least return difference of a regulator, but for the rounding of its gain, and one below which a gain is of none.
_REGULATOR, _NO_REGULATOR = 0.995, 0.9
# Part of displacements in a gain over that of velocities, in coordinates of the energy, below which it has hardly any.
_HARDLY = 0.01
_FREQUENCIES, _ROUNDING = 150, 1e-9
# Sample times [s] of gains of `dlqr`, beside that of the loop; unequal parts of K F^-1 G that are rounding of the gain.
_SAMPLE_TIMES, _UNEQUAL = (0.005, 0.01, 0.02, 0.05), 0.01
# Part of its damping by which a gain moves a pole at least that is to do something.
_LEAST_MOVE = 0.05
# Places about each pole, in half widths of its resonance.
_ABOUT = np.sinh(np.linspace(-4.0, 4.0, 15))

_CONVENTION: Final = RemarkKind(
    "gain_convention",
    "as f_c = -K s, a force that resists the lengthening of its device, with all displacements before all velocities, "
    "lowest first, the gain {0}; it {1} as {2}",
    "give the gain that is meant",
)
_UNSTABLE: Final = RemarkKind(
    "gain_unstable",
    "the linear loop of the gain is not stable, with forces of either sign and other orders of its columns neither",
    "give a gain of this building in N/m and N s/m",
)
_WEAK: Final = RemarkKind(
    "gain_weak",
    "the gain moves no pole of the building by more than {share:.2g} % of its damping",
    "give it in N/m and N s/m; in kN it is a thousandth",
)
_HELD: Final = RemarkKind(
    "loop_held_unstable",
    "the linear loop of the gain is stable with continuous forces, and not with sample time, delay and lag of the "
    "hardware",
    "shorten them, or take a smaller gain, as of a larger R",
)
_SAMPLED: Final = RemarkKind(
    "gain_of_samples",
    "the linear loop of the gain {1} in samples of {0} s, as that of a gain of `dlqr`, and not with continuous forces: "
    "the gain holds for that sample time",
)


def gain_remarks(
    plant: Plant,
    gain: Floats,
    *,
    given: bool = True,
    margins: LoopMargins | None = None,
    sample_time: float = 1e-3,
) -> Iterator[Remark]:
    """Remarks on the loop of a gain K of `f_c = -K s`, shape (n_devices, 2n): whether other readings fit better.

    A gain that is `given` may follow another convention. The one that is meant has a stable loop; that of a regulator
    with R in proportion to 1 has also a return difference of at least 1 at all frequencies, in samples too, whatever
    its weights, which other signs, orders and sample times seldom have. `margins` are those of the loop with its
    hardware. Of 100 coordinates, or 400 coordinates times devices, and more there are none.
    """
    if plant.n_coordinates * max(plant.n_devices, 4) > _MOST_LOOPS or not (
        np.isfinite(gain).all() and gain.any()
    ):
        return
    stable = _is_stable(plant, gain)
    is_sound = stable and _return_difference(plant, gain) > _NO_REGULATOR
    x, v = np.hsplit(gain @ plant.scaling, 2)
    is_swapped = is_sound and np.linalg.norm(x) < _HARDLY * np.linalg.norm(v)
    of_samples = [
        f"{time:g}"
        for time in dict.fromkeys((sample_time, *_SAMPLE_TIMES) if given and not is_sound else ())
        if _is_stable(plant, gain, time) and _return_difference(plant, gain, time) > _REGULATOR
    ]
    if given and not stable and _is_stable(plant, gain, sample_time):
        yield _SAMPLED.remark(f"{sample_time:g}", "is stable")
    elif f"{sample_time:g}" in of_samples:
        yield _SAMPLED.remark(f"{sample_time:g}", "is that of a regulator")
    elif given and (is_swapped or not is_sound):
        others = {
            words: _return_difference(plant, K) > _REGULATOR
            for words, K in _readings(plant, gain)
            if (words == _SWAPPED or not is_swapped)
            and (_is_stable(plant, K) or (words == _PUSHES and _is_stable(plant, K, sample_time)))
        }
        # Where our loop is not stable, that of the other sign is named in any case, and every one if none is sure.
        named = [] if stable else [_PUSHES] if any(others.values()) else [*others]
        fitting = [words for words, is_regulator in others.items() if is_regulator or words in named]
        fitting += [f"K of `dlqr` in samples of {' or '.join(of_samples)} s"] if of_samples else []
        if fitting:
            words = ("is no regulator", "is one") if stable else ("has an unstable loop", "has a stable one")
            words = ("is a regulator of velocities alone", "is one of both") if is_swapped else words
            yield _CONVENTION.remark(*words, " or ".join(fitting))
        elif not stable:
            yield _UNSTABLE.remark()
    elif given and (moved := _largest_move(plant, gain)) < _LEAST_MOVE:
        yield _WEAK.remark(share=100.0 * moved)
    if stable and margins is not None and not margins.stable:
        yield _HELD.remark()


_PUSHES = "-K, which is K of `lqr` with forces that push the floors, B = [0; M^-1 D]"
_SWAPPED = "velocities before displacements"


def _readings(plant: Plant, gain: Floats) -> Iterator[tuple[str, Floats]]:
    """The gain with other conventions in words, as it stands in ours."""
    n, drifts = plant.n_coordinates, plant.building.drifts
    x, v = gain[:, :n], gain[:, n:]
    orders = {
        _SWAPPED: (v, x),
        "displacement and velocity of each coordinate by turns": (gain[:, ::2], gain[:, 1::2]),
        "the coordinates from the top down": (x[:, ::-1], v[:, ::-1]),
    }
    if drifts.shape == (n, n):
        orders["drifts of the storeys in place of displacements"] = (x @ drifts, v @ drifts)
    yield _PUSHES, -gain
    for words, columns in orders.items():
        K = np.hstack(columns)
        # Of one coordinate most orders are the same.
        if not np.array_equal(K, gain):
            yield from ((words, K), (f"-K and {words}", -K))
    for device, name in enumerate(plant.device_names if len(gain) > 1 else ()):
        signs = np.where(np.arange(len(gain)) == device, -1.0, 1.0)
        yield f"the other sign of {name} alone", signs[:, None] * gain
    if len(gain) > 1:
        yield "rows of the devices in the other order", gain[::-1]
        yield "-K and rows of the devices in the other order", -gain[::-1]


def _largest_move(plant: Plant, gain: Floats) -> float:
    """Largest change of a pole by a gain over the decay of that pole, for changes far below its distance to others."""
    T = plant.scaling
    of_loops = (np.linalg.eigvals(np.linalg.solve(T, A @ T)) for A in (plant.A, plant.A - plant.B @ gain))
    poles, moved = (each[np.lexsort((each.real, each.imag))] for each in of_loops)
    decay = np.abs(poles.real)
    return float(
        np.divide(np.abs(moved - poles), decay, out=np.full(decay.shape, np.inf), where=decay > 0.0).max()
    )


def _is_stable(plant: Plant, gain: Floats, sample_time: float = 0.0) -> bool:
    """Whether the loop of a gain is stable, with continuous forces or in samples [s]."""
    T, A, B = plant.scaling, plant.A, plant.B
    if sample_time:
        A, B = hold_input(A, B, sample_time)
    poles = np.linalg.eigvals(np.linalg.solve(T, (A - B @ gain) @ T))
    growth = np.abs(poles).max() - 1.0 if sample_time else poles.real.max() / np.abs(poles).max()
    # A mode without damping that no device moves is not the fault of a gain.
    return bool(growth < _ROUNDING)


def _return_difference(plant: Plant, gain: Floats, sample_time: float = 0.0) -> float:
    """Least singular value of `1 + K (j w - A)^-1 B` over the frequencies w (Kalman, J. Basic Eng. 86, 1964, 51-60).

    In samples [s], of `S^(1/2) (1 + K (z - F)^-1 G)` with S = 1 + G'P G over R, which is (1 - K F^-1 G)^-1 for a
    regulator, where P G = F'^-1 K' S. Zero without such an S.
    """
    T = plant.scaling
    poles, V = np.linalg.eig(np.linalg.solve(T, plant.A @ T))
    pushed, seen = np.linalg.pinv(V) @ np.linalg.solve(T, plant.B), gain @ T @ V
    size = np.abs(poles)
    upper = poles[poles.imag >= 0.0]
    about = upper.imag[:, None] + np.abs(upper.real)[:, None] * _ABOUT
    wide = np.geomspace(1e-2 * max(size.min(), 1e-3 * size.max()), 1e2 * size.max(), _FREQUENCIES)
    frequencies = np.unique(np.concatenate([wide, about.ravel()]))
    points, one, root = 1j * frequencies, np.eye(len(gain)), np.eye(len(gain))
    if sample_time:
        points = np.exp(1j * np.linspace(0.0, np.pi, _FREQUENCIES))
        points = np.append(points, np.exp(1j * sample_time * frequencies[frequencies < np.pi / sample_time]))
        with np.errstate(divide="ignore", invalid="ignore"):
            held = np.where(size > 0.0, np.expm1(poles * sample_time) / poles, sample_time)[:, None] * pushed
        poles = np.exp(poles * sample_time)
        left = (seen / poles @ held).real
        values, vectors = np.linalg.eigh(one - symmetric_part(left))
        unequal = np.linalg.norm(left - left.T) > _UNEQUAL * np.linalg.norm(left)
        if unequal or values.min() <= 0.0 or values.max() > 1.0 + _ROUNDING:
            return 0.0
        pushed, root = held, values[:, None] ** -0.5 * vectors.T
    with np.errstate(divide="ignore", invalid="ignore"):
        L = (seen / (points[:, None, None] - poles)) @ pushed
    # At a pole without damping it is infinite.
    L = L[np.isfinite(L).all(axis=(1, 2))]
    return float(np.linalg.svd(root @ (one + L), compute_uv=False)[:, -1].min(initial=np.inf))

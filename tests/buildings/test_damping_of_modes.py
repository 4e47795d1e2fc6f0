"""Modes that grow are refused, modes without damping or stiffness are said, and a damped building is silent."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from refusals import refusal

import mrwork as mr
from mrwork import buildings
from mrwork.base.remark import Measured
from mrwork.buildings import modes  # the quick check and the poles, which no public function shows apart
from mrwork.buildings.state_space import building_of

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
UTS = mr.building("uts")


def with_ratios(*ratios: float) -> Floats:
    """The damping matrix of the five-storey frame with these damping ratios."""
    shapes = UTS.mass @ UTS.modes
    omega = 2.0 * np.pi * UTS.frequencies
    return np.asarray(shapes @ np.diag(2.0 * np.array(ratios) * omega) @ shapes.T)


def dashpot(storey: int) -> Floats:
    """A dashpot across one storey: damping that couples the modes."""
    row = UTS.storeys[storey]
    return np.asarray(500.0 * np.outer(row, row))


GROW = {
    "the sign of all": (-UTS.damping, "5 of 5 modes have.* mode 5 at 20.21 Hz with the ratio -0.0133"),
    "one mode": (with_ratios(0.01, 0.01, -0.01, 0.01, 0.01), "1 of 5 modes has.* mode 3 at 13.76 Hz"),
    "an overdamped mode that grows": (
        UTS.damping - 1e5 * np.diag([0.0, 0.0, 0.0, 0.0, 1.0]),
        "3 of 5 modes have.* mode 1 at 4.649 Hz with the ratio -1",
    ),
}


@pytest.mark.parametrize(("damping", "words"), GROW.values(), ids=GROW)
def test_a_building_with_a_mode_that_grows_is_refused(damping: Floats, words: str) -> None:
    refusal(lambda: replace(UTS, damping=damping).check(), match=words)


def test_the_ratio_in_the_sentence_is_that_of_the_pole() -> None:
    """Also where dashpots couple the modes, so that the diagonal of the modal damping is another number."""
    damping = 0.5 * UTS.damping - dashpot(4)
    n = 5
    solved = np.linalg.solve(UTS.mass, np.hstack([-UTS.stiffness, -damping]))
    poles = np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, k=n), solved]))
    worst = poles[np.argmax(poles.real / np.abs(poles))]
    wanted = f"at {abs(worst) / (2.0 * np.pi):.4g} Hz with the ratio {-worst.real / abs(worst):.3g}"
    refusal(lambda: replace(UTS, damping=damping).check(), match=wanted)


UNDAMPED = {
    "no damping": (0.0 * UTS.damping, "uts: 5 of 5 modes have no damping; "),
    "rounding below zero": (
        with_ratios(0.01, -1e-9, 0.01, 0.01, 0.01),
        "uts: 1 of 5 modes has no damping, the lowest of these at 8.74 Hz; ",
    ),
}


@pytest.mark.parametrize(("damping", "words"), UNDAMPED.values(), ids=UNDAMPED)
def test_undamped_modes_are_said_by_the_building_and_its_summary(damping: Floats, words: str) -> None:
    frame = replace(UTS, damping=damping)
    (said,) = frame.damping_remarks
    assert said.code == "modes_undamped"
    assert said.message.startswith(words)
    assert words in " ".join(repr(frame).split())


DAMPED = {
    "published": UTS.damping,
    "little": with_ratios(*5 * [1e-5]),
    "one dashpot": dashpot(0),
    "one strong dashpot": 1e3 * dashpot(2),
    "a gyroscopic part": UTS.damping + 300.0 * (np.eye(5, k=1) - np.eye(5, k=-1)),
    "overdamped": with_ratios(2.0, 0.01, 0.01, 0.01, 3.0),
}


@pytest.mark.parametrize("damping", DAMPED.values(), ids=DAMPED)
def test_a_damped_building_is_silent(damping: Floats) -> None:
    frame = replace(UTS, damping=damping)
    assert frame.damping_remarks == ()
    overdamped = (
        np.einsum("im,ij,jm->m", frame.modes, damping, frame.modes) > 4.0 * np.pi * frame.frequencies
    ).any()
    assert ("warning" in repr(frame)) == overdamped


@pytest.mark.parametrize(
    "add",
    [
        lambda frame: buildings.with_brace(frame, storey=1, stiffness=1e7, mass=20.0),
        lambda frame: buildings.with_brace(frame, storey=1, stiffness=1e8, mass=1.0),
        lambda frame: buildings.with_tuned_mass(frame, floor=5, mass=30.0, frequency=0.1, ratio=0.0),
    ],
    ids=["brace", "light brace", "slow mass"],
)
def test_an_undamped_addition_is_no_undamped_frame(add: Callable[[mr.Building], mr.Building]) -> None:
    assert add(UTS).damping_remarks == ()
    (said,) = add(replace(UTS, damping=0.0 * UTS.damping)).damping_remarks
    assert "6 of 6 modes have no damping" in said.message


def test_damping_that_drives_a_motion_of_no_mode_is_said() -> None:
    """A dashpot of the wrong sign may hide behind the damping of the others."""
    frame = replace(UTS, damping=UTS.damping - 1.2 * dashpot(2))
    assert np.linalg.eigvalsh(frame.damping)[0] < 0.0 > frame.poles.real.max()
    assert [each.code for each in frame.damping_remarks] == ["damping_drives"]


@pytest.mark.parametrize("damping", [0.0, 0.3], ids=["undamped", "damped"])
def test_a_motion_without_stiffness_is_said_apart(damping: float) -> None:
    stiffness = UTS.stiffness - 1.448e6 * np.diag([1.0, 0.0, 0.0, 0.0, 0.0])
    frame = replace(UTS, stiffness=stiffness, damping=damping * UTS.mass)
    free, *undamped = frame.damping_remarks
    assert free.code == "modes_free"
    assert [each.code for each in undamped] == ([] if damping else ["modes_undamped"])
    # Damping in proportion to the stiffness leaves the free motion alone.
    grows = replace(UTS, stiffness=stiffness, damping=1e-3 * stiffness - 0.1 * UTS.mass)
    refusal(grows.check, match="ratio -1")


def test_negative_damping_is_refused_wherever_a_building_is_from(tmp_path: Path) -> None:
    for letter, matrix in (("M", UTS.mass), ("C", -UTS.damping), ("K", UTS.stiffness)):
        np.savetxt(tmp_path / f"{letter}.csv", matrix, delimiter=",")
    refusal(buildings.read_building, tmp_path, match="5 of 5 modes have negative damping")
    grows = UTS.state_matrices(UTS.storeys)[0].copy()
    grows[5:, 5:] *= -1.0
    refusal(building_of(grows, name="x").check, match="5 of 5 modes have negative damping")


@examples(60)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.floats(-0.5, 0.5))
def test_the_quick_check_never_clears_what_the_poles_contradict(n: int, seed: int, part: float) -> None:
    """Random masses, springs and dashpots, some of which drive."""
    rng = np.random.default_rng(seed)
    rows = np.eye(n) - np.eye(n, k=-1)
    mass = np.diag(rng.uniform(0.1, 10.0, n))
    stiffness = rows.T @ np.diag(10.0 ** rng.uniform(0.0, 6.0, n)) @ rows
    damping = rows.T @ np.diag(10.0 ** rng.uniform(-2.0, 3.0, n) * (rng.random(n) > part)) @ rows
    damping -= max(part, 0.0) * np.diag(np.diag(damping) * rng.random(n))
    found = modes.modal_damping(mass, damping, stiffness, np.eye(n))
    assert len(found.ratio) == n
    for ratio in (-modes.UNDAMPED, modes.UNDAMPED, 0.01):
        if modes.is_damped(mass, damping, stiffness, ratio):
            assert found.ratio.min() >= ratio - 1e-9


def test_a_tall_building_with_one_undamped_mode_is_found_without_coupling() -> None:
    n = 320
    frame = buildings.shear_building(name="tall", masses=n * [3e5], stiffnesses=n * [6e8])
    ratios = np.full(n, 0.02)
    ratios[6] = 0.0
    tall = buildings.with_modal_damping(frame, ratios=ratios.tolist())
    (found,) = tall.damping_remarks
    assert found.code == "modes_undamped"
    assert found.measured == Measured(pytest.approx(frame.frequencies[6]), "Hz")

"""What every control law promises, run over the registry: a law that is listed is held to it, without an edit here.

Its numbers stand in `loop_samples.law_with_gains`, its formula again, in NumPy, in `law_formulas`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from law_formulas import FORMULAS, SEARCHED, Recorded, commands
from loop_samples import (
    LARGEST,
    at_samples,
    devices,
    five_storeys,
    friction,
    law_with_gains,
    plant_with,
    rd1005,
    still,
    sweep,
)

from mrwork import Device
from mrwork.closed_loop import Fault, Hardware, History, Responses, simulate_loop
from mrwork.control import ControlLaw, ControlLawSpec, control_laws
from mrwork.dampers.simulation import Outcome
from mrwork.errors import ArgumentError, SettingError

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

SHORT = sweep(0.2)
# The gains of a law are those of others, too; a constant command beyond its driver is told.
pytestmark = pytest.mark.filterwarnings("ignore:.*whose driver gives:mrwork.errors.MrworkWarning")


def name_of(spec: ControlLawSpec) -> str:
    return spec.name


# The active force goes to an actuator without limits, which may push energy into the building.
SEMI_ACTIVE = [spec for spec in control_laws() if spec.name != "active"]
WITH_GAINS = [spec for spec in control_laws() if spec.gains]


@pytest.fixture(params=control_laws(), ids=name_of)
def spec(request: pytest.FixtureRequest) -> ControlLawSpec:
    """Every registered law in turn."""
    return request.param


def law_of(spec: ControlLawSpec, loop: list[Device], *, strength: float = 1.0) -> ControlLaw:
    return law_with_gains(spec.name, plant_with(loop), strength=strength)


def run_of(law: ControlLaw, loop: list[Device], hardware: Hardware | None = None) -> History:
    response = simulate_loop(five_storeys(), loop, law, [sweep()], hardware, histories=True)
    assert response.outcome[0] == Outcome.FINISHED
    return at_samples(response)


def candidates(spec: ControlLawSpec, loop: list[Device], count: int) -> ControlLaw:
    """The law with as many sets of gains, from a third to thrice the usual ones."""
    law = law_of(spec, loop)
    factors = 3.0 ** np.linspace(-1.0, 1.0, count)
    return replace(law, gains={name: np.multiply.outer(factors, gain) for name, gain in law.gains.items()})


def only(law: ControlLaw, rows: slice | Floats) -> ControlLaw:
    return replace(law, gains={name: np.asarray(gain)[rows] for name, gain in law.gains.items()})


def bits(response: Responses) -> Floats:
    """All numbers of all runs, shape (n_runs, n_numbers)."""
    arrays = [response.outcome, response.steps, *response.numbers.values()]
    assert len(arrays) > 10
    return np.hstack([np.reshape(array, (len(response.outcome), -1)) for array in arrays])


def assert_same_bits(left: Responses, right: Responses) -> None:
    np.testing.assert_array_equal(bits(left).view(np.uint64), bits(right).view(np.uint64))


def test_every_law_has_its_formula_in_the_tests() -> None:
    assert list(FORMULAS) == [spec.name for spec in control_laws()]


def test_a_law_says_what_it_is(spec: ControlLawSpec) -> None:
    assert spec.title
    assert spec.equation
    assert spec.description.endswith(".")
    assert spec.source
    assert all(
        gain.unit and gain.description and gain.shape in ("device", "state", "numbers", "signal", "loop")
        for gain in spec.gains
    )


@pytest.mark.parametrize("sample_time", [1e-3, 4e-3])
def test_commands_are_those_of_the_formula(spec: ControlLawSpec, sample_time: float) -> None:
    loop = devices(rd1005())
    law = law_of(spec, loop)
    run = run_of(law, loop, Hardware(sample_time=sample_time))
    seen = Recorded.of(law, five_storeys(), loop, sweep(), run, sample_time)
    expected = commands(seen)
    if spec.name in SEARCHED:
        force = seen.believed(expected)
        np.testing.assert_allclose(
            seen.believed(run.command), force, rtol=0.0, atol=1e-5 * np.abs(force).max()
        )
        np.testing.assert_allclose(run.command, expected, rtol=0.0, atol=5e-3 * LARGEST)
    else:
        # Rounding differs; a switch is turned by it only where its argument vanishes, as at rest. The coils start
        # settled at the first command, with another force than the one that the law has measured.
        largest = np.abs(expected).max()
        np.testing.assert_allclose(run.command[1:], expected[1:], rtol=1e-9, atol=1e-9 * largest)
    assert np.ptp(run.command) > 0.0 or spec.name == "passive"


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_commands_stay_in_their_range(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    loop[1] = replace(loop[1], largest_command=0.7)
    for strength in (1.0, -1.0, 1e3):
        run = run_of(law_of(spec, loop, strength=strength), loop)
        assert np.all((run.command >= 0.0) & (run.command <= [LARGEST, 0.7]))
        assert np.all((run.current >= 0.0) & (run.current <= [LARGEST, 0.7]))


@pytest.mark.parametrize(
    "spec",
    [
        spec
        for spec in WITH_GAINS
        if spec.name not in {"inverse_direct", "inverse_parabola", "signal_network", "mixed_skyhook"}
    ],
    ids=name_of,
)
def test_a_law_that_asks_for_nothing_sends_nothing(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    run = run_of(law_of(spec, loop, strength=0.0), loop)
    np.testing.assert_array_equal(run.command, 0.0)


def test_a_building_at_rest_stays_at_rest(spec: ControlLawSpec) -> None:
    loop = devices(friction())
    response = simulate_loop(five_storeys(), loop, law_of(spec, loop), [still()])
    np.testing.assert_array_equal(response.peak_displacement, 0.0)
    np.testing.assert_array_equal(response.energy_error, 0.0)


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_friction_never_gives_energy_back(spec: ControlLawSpec) -> None:
    loop = devices(friction())
    work = run_of(law_of(spec, loop), loop).device_energy
    # Force times rate is positive at every stage of every step, so every step adds.
    assert np.all(np.diff(work, axis=0) >= 0.0)
    assert np.all(work[-1] > 0.0)


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_a_hysteretic_device_gives_back_no_more_than_it_may_hold(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    run = run_of(law_of(spec, loop), loop)
    # On the way back from |x|, each damper returns at most the k x and alpha tanh(delta) of its best command, on the
    # way out it takes at least the k x of its worst (Kwok et al. 2006); the constant force moves with x alone.
    stiffest, softest = 5100.0, 5100.0 - 1700.0 * LARGEST
    hysteresis = max(-244.0 * i**2 + 918.0 * i + 32.0 for i in np.linspace(0.0, LARGEST, 100))
    hysteresis *= np.tanh(0.30 * LARGEST + 0.58)
    x = np.abs(run.deformation)
    out = np.diff(x, axis=0) > 0.0
    strain = 0.5 * np.abs(np.diff(x**2, axis=0))
    least = np.where(out, softest * strain, -stiffest * strain - hysteresis * np.abs(np.diff(x, axis=0)))
    constant = np.array([0.0, 57.0]) * np.abs(np.diff(run.deformation, axis=0))
    bound = 2.0 * np.cumsum(least - constant, axis=0)
    assert np.all(run.device_energy[1:] >= bound - 1e-3 * np.abs(bound) - 1e-6)
    assert np.all(run.device_energy[-1] > 0.0)


def test_batch_is_the_loop_over_its_candidates(spec: ControlLawSpec, instruction_set: str) -> None:
    # Twice 17 runs leave blocks of every width partly empty.
    loop = devices(rd1005())
    law = candidates(spec, loop, 17)
    motions = [SHORT, sweep(0.2, peak=0.7)]
    batch = simulate_loop(five_storeys(), loop, law, motions)
    for candidate in (0, 7, len(batch.outcome) // 2 - 1):
        chosen = law if not law.gains else only(law, slice(candidate, candidate + 1))
        for number, motion in enumerate(motions):
            alone = simulate_loop(five_storeys(), loop, chosen, [motion])
            row = 0 if not law.gains else 2 * candidate
            np.testing.assert_array_equal(
                bits(batch)[row + number].view(np.uint64), bits(alone)[0].view(np.uint64)
            )


def test_histories_are_those_of_the_run_alone(spec: ControlLawSpec, instruction_set: str) -> None:
    loop = devices(rd1005())
    law = candidates(spec, loop, 5)
    batch = simulate_loop(five_storeys(), loop, law, [SHORT], histories=True)
    chosen = only(law, slice(2, 3)) if law.gains else law
    alone = simulate_loop(five_storeys(), loop, chosen, [SHORT], histories=True)
    assert batch.histories is not None
    assert alone.histories is not None
    run = batch.histories[2 if law.gains else 0]
    for name, signal in run.numbers.items():
        np.testing.assert_array_equal(signal, alone.histories[0].numbers[name])


def test_instruction_sets_give_the_same_bits(
    spec: ControlLawSpec, of_instruction_sets: Callable[[Callable[[], Responses]], list[Responses]]
) -> None:
    loop = devices(rd1005())
    *others, plain = of_instruction_sets(
        lambda: simulate_loop(five_storeys(), loop, candidates(spec, loop, 9), [SHORT])
    )
    for other in others:
        assert_same_bits(other, plain)


def test_threads_give_the_same_bits(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    one, two = (
        simulate_loop(five_storeys(), loop, candidates(spec, loop, 70), [SHORT], threads=threads)
        for threads in (1, 2)
    )
    assert_same_bits(one, two)


@pytest.mark.parametrize("spec", WITH_GAINS, ids=name_of)
def test_gains_that_are_no_numbers_are_refused(spec: ControlLawSpec) -> None:
    law = candidates(spec, devices(rd1005()), 9)
    for name in law.gains:
        broken = np.array(law.gains[name])
        broken[4] = np.nan
        with pytest.raises(SettingError, match=rf"`gains\['{name}'\]` of ControlLaw is nan"):
            replace(law, gains={**law.gains, name: broken})


@pytest.mark.parametrize("spec", WITH_GAINS, ids=name_of)
@pytest.mark.parametrize("bad", [np.inf, -np.inf])
def test_infinite_gains_have_a_named_end_and_spare_their_neighbours(spec: ControlLawSpec, bad: float) -> None:
    # With heights nothing of a run is unknown.
    loop, tall = devices(rd1005()), replace(five_storeys(), heights=np.full(5, 3.0))
    law = candidates(spec, loop, 9)
    clean = simulate_loop(tall, loop, law, [SHORT])
    for name in law.gains:
        broken = np.array(law.gains[name])
        broken[4] = bad
        run = simulate_loop(tall, loop, replace(law, gains={**law.gains, name: broken}), [SHORT])
        others = np.arange(9) != 4
        np.testing.assert_array_equal(bits(run)[others].view(np.uint64), bits(clean)[others].view(np.uint64))
        numbers = bits(run)[4]
        assert not np.any(np.isnan(numbers))
        if run.outcome[4] in (Outcome.FINISHED, Outcome.FAILED_SAFE):
            assert np.all(np.isfinite(numbers))
        else:
            assert np.isposinf(run.peak_drift[4]).all()


# What a law measures besides the state, which an observer keeps clear of such readings.
MEASURED = {
    "force": {
        "clipped_optimal",
        "modified_clipped_optimal",
        "proportional_clipped_optimal",
        "lyapunov",
        "decentralised_bang_bang",
        "maximum_energy_dissipation",
        "modulated_homogeneous_friction",
        "sliding_mode",
        "adaptive_sliding_mode",
        "signal_network",
        "signal_polynomial",
        "predictive_rollout",
    },
    "deformation": {
        "super_twisting",
        "fuzzy",
        "lyapunov_direct",
        "lyapunov_parabola",
        "lyapunov_direct_bang_bang",
        "proportional_direct",
        "inverse_direct",
        "inverse_parabola",
        "inverse_network",
        "signal_network",
        "signal_polynomial",
        "predictive_rollout",
    },
}


@pytest.mark.parametrize("channel", ["force", "deformation"])
def test_a_reading_that_is_no_number_sends_no_current(spec: ControlLawSpec, channel: str) -> None:
    loop = devices(rd1005())
    fault = Fault(channel=channel, index=1, start=0.05, end=0.1, value=np.nan)
    run = simulate_loop(
        five_storeys(), loop, law_of(spec, loop), [SHORT], Hardware(faults=(fault,)), histories=True
    )
    assert run.histories is not None
    command = run.histories[0].command
    if spec.name in MEASURED[channel]:
        assert run.outcome[0] == Outcome.FAILED_SAFE
        np.testing.assert_array_equal(command[50:100, 1], 0.0)
    elif spec.name != "modulated_homogeneous_friction":
        without = simulate_loop(five_storeys(), loop, law_of(spec, loop), [SHORT], histories=True)
        assert without.histories is not None
        np.testing.assert_array_equal(command, without.histories[0].command)
        assert run.outcome[0] == Outcome.FINISHED


@pytest.mark.parametrize("name", ["fuzzy", "inverse_network", "signal_polynomial"])
@pytest.mark.parametrize("size", [0, 1, 2, 5])
def test_tables_that_a_law_cannot_read_are_refused(name: str, size: int) -> None:
    loop = devices(rd1005())
    law = law_with_gains(name, plant_with(loop))
    for table in law.tables:
        if (table, size) not in {("output", 1), ("terms", 5)}:
            broken = replace(law, tables={**law.tables, table: np.ones(size)})
            with pytest.raises(SettingError, match=f"table `(terms|reach|{table})` of the law `{name}`"):
                simulate_loop(five_storeys(), loop, broken, [SHORT])


def test_gains_of_the_wrong_shape_are_refused(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    law = law_of(spec, loop)
    for name, gain in law.gains.items():
        for wrong in (np.asarray(gain)[..., :-1], np.zeros((2, 3, *np.shape(gain)))):
            with pytest.raises(SettingError, match=f"^`{name}` of {spec.name} has shape"):
                simulate_loop(five_storeys(), loop, replace(law, gains={**law.gains, name: wrong}), [SHORT])
    with pytest.raises(SettingError, match="has no gain 'more'"):
        replace(law, gains={**law.gains, "more": 1.0})
    for name in law.gains:
        with pytest.raises(SettingError, match=f"has no gain '{name}s', did you mean {name}"):
            replace(law, gains={**law.gains, f"{name}s": 1.0})
        with pytest.raises(SettingError, match=f"{spec.name} lacks the gain '{name}'"):
            replace(law, gains={key: gain for key, gain in law.gains.items() if key != name})
        with pytest.raises(
            ArgumentError, match=rf"`gains\['{name}'\]` of ControlLaw is 'large'; give an array"
        ):
            replace(law, gains={**law.gains, name: "large"})


@pytest.mark.parametrize("spec", [spec for spec in control_laws() if spec.needs_curve], ids=name_of)
def test_a_law_without_its_curve_is_refused(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    with pytest.raises(SettingError, match="give it a `curve`"):
        replace(law_of(spec, loop), curve=None)

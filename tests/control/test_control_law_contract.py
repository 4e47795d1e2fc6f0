"""What every control law promises, run over the registry: a law that is listed is held to it, without an edit here.

Its numbers stand in `loop_samples.law_with_gains`, its formula again, in NumPy, in `law_formulas`.
"""

from dataclasses import replace

import numpy as np
import pytest
from loop_samples import (
    LARGEST,
    devices,
    five_storeys,
    friction,
    law_with_gains,
    plant_with,
    rd1005,
    run_of,
    still,
    sweep,
)
from refusals import refusal

import mrwork as mr
from mrwork import Device
from mrwork.closed_loop import Fault, Hardware, Responses, simulate_loop
from mrwork.control import ControlLaw, ControlLawSpec, control_laws
from mrwork.dampers.simulation import Outcome
from mrwork.motions import trimmed
from tests.control.law_formulas import FORMULAS, SEARCHED, Recorded, commands

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


def assert_same_numbers(left: Floats, right: Floats) -> None:
    np.testing.assert_array_equal(left.view(np.uint64), right.view(np.uint64))


def test_every_law_has_its_formula_in_the_tests() -> None:
    assert list(FORMULAS) == [spec.name for spec in control_laws()]


def test_a_law_says_what_it_is(spec: ControlLawSpec) -> None:
    assert spec.title
    assert spec.equation
    assert spec.description.endswith(".")
    assert spec.source
    assert all(
        gain.unit and gain.description and gain.shape in ("device", "state", "numbers", "loop")
        for gain in spec.gains
    )


@pytest.mark.parametrize("sample_time", [1e-3, 4e-3])
def test_commands_are_those_of_the_formula(spec: ControlLawSpec, sample_time: float) -> None:
    loop = devices(rd1005())
    law = law_of(spec, loop)
    # The rollout and a search in NumPy take milliseconds for a decision.
    motion = trimmed(sweep(), end=0.4 if spec.needs_model or spec.name in SEARCHED else 1.5)
    run = run_of(loop, law, Hardware(sample_time=sample_time), motion)
    seen = Recorded.of(law, five_storeys(), loop, motion, run, sample_time)
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


def test_a_current_inside_the_tanh_is_inverted_and_the_parabola_does_not() -> None:
    """The force of such a curve saturates early, and no parabola has its shape."""
    spec = mr.damper("static_hysteretic").with_current_laws({"beta": "quadratic", "delta": "quadratic"})
    curve = spec, np.array([1232.0, 5100.0, 700.0, 0.5, 10.0, 100.0, 0.0, 0.3, 1.0, 1e-4, 57.0])
    loop, missed = devices(rd1005()), []
    for name in ("inverse_direct", "inverse_parabola"):
        law = replace(law_with_gains(name, plant_with(loop)), curve=curve)
        run = run_of(loop, law, motion=SHORT)
        seen = Recorded.of(law, five_storeys(), loop, SHORT, run, 1e-3)
        found, best = (seen.believed(each) for each in (run.command, FORMULAS["inverse_direct"](seen)))
        apart = np.abs(found - seen.wanted) - np.abs(best - seen.wanted)
        missed.append(apart.max() / np.abs(best).max())
    assert missed[0] < 1e-5
    assert missed[1] > 1e-2


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_commands_stay_in_their_range(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    loop[1] = replace(loop[1], largest_command=0.7)
    for strength in (1.0, -1.0, 1e3):
        run = run_of(loop, law_of(spec, loop, strength=strength), motion=sweep())
        assert np.all((run.command >= 0.0) & (run.command <= [LARGEST, 0.7]))
        assert np.all((run.current >= 0.0) & (run.current <= [LARGEST, 0.7]))


@pytest.mark.parametrize(
    "spec",
    [
        spec
        for spec in WITH_GAINS
        if spec.name
        not in {"inverse_direct", "inverse_parabola", "signal_network", "mixed_skyhook", "skyhook_groundhook"}
    ],
    ids=name_of,
)
def test_a_law_that_asks_for_nothing_sends_nothing(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    run = run_of(loop, law_of(spec, loop, strength=0.0), motion=sweep())
    np.testing.assert_array_equal(run.command, 0.0)


def test_a_building_at_rest_stays_at_rest(spec: ControlLawSpec) -> None:
    loop = devices(friction())
    response = simulate_loop(five_storeys(), loop, law_of(spec, loop), [still()])
    np.testing.assert_array_equal(response.peak_displacement, 0.0)
    np.testing.assert_array_equal(response.energy_error, 0.0)


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_friction_never_gives_energy_back(spec: ControlLawSpec) -> None:
    loop = devices(friction())
    work = run_of(loop, law_of(spec, loop), motion=sweep()).device_energy
    # Force times rate is positive at every stage of every step, so every step adds.
    assert np.all(np.diff(work, axis=0) >= 0.0)
    assert np.all(work[-1] > 0.0)


@pytest.mark.parametrize("spec", SEMI_ACTIVE, ids=name_of)
def test_a_hysteretic_device_gives_back_no_more_than_it_may_hold(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    run = run_of(loop, law_of(spec, loop), motion=sweep())
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


# Of the first instruction set in which a law has run.
OF_BATCH: dict[str, Floats] = {}


def test_batch_is_the_loop_over_its_candidates_with_the_bits_of_every_instruction_set(
    spec: ControlLawSpec, instruction_set: str
) -> None:
    # Twice 17 runs leave blocks of every width partly empty.
    loop = devices(rd1005())
    law = candidates(spec, loop, 17)
    motions = [sweep(0.1), sweep(0.1, peak=0.7)]
    batch = simulate_loop(five_storeys(), loop, law, motions, histories=True)
    for candidate in (0, 7, len(batch.outcome) // 2 - 1):
        chosen = only(law, slice(candidate, candidate + 1)) if law.gains else law
        for number, motion in enumerate(motions):
            alone = simulate_loop(five_storeys(), loop, chosen, [motion], histories=True)
            row = number + (2 * candidate if law.gains else 0)
            assert_same_numbers(bits(batch)[row], bits(alone)[0])
            for name, signal in batch.histories[row].numbers.items():
                np.testing.assert_array_equal(signal, alone.histories[0].numbers[name])
    assert_same_numbers(bits(batch), OF_BATCH.setdefault(spec.name, bits(batch)))


def test_threads_give_the_same_bits(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    one, two = (
        simulate_loop(five_storeys(), loop, candidates(spec, loop, 70), [SHORT], threads=threads)
        for threads in (1, 2)
    )
    assert_same_numbers(bits(one), bits(two))


@pytest.mark.parametrize("spec", WITH_GAINS, ids=name_of)
def test_infinite_gains_have_a_named_end_and_spare_their_neighbours(spec: ControlLawSpec) -> None:
    # With heights nothing of a run is unknown.
    loop, tall = devices(rd1005()), replace(five_storeys(), heights=np.full(5, 3.0))
    law = candidates(spec, loop, 9)
    clean = simulate_loop(tall, loop, law, [SHORT])
    for name in law.gains:
        broken = np.array(law.gains[name])
        broken[4], broken[6] = np.inf, -np.inf
        run = simulate_loop(tall, loop, replace(law, gains={**law.gains, name: broken}), [SHORT])
        others = np.isin(np.arange(9), (4, 6), invert=True)
        assert_same_numbers(bits(run)[others], bits(clean)[others])
        for place in (4, 6):
            numbers = bits(run)[place]
            assert not np.any(np.isnan(numbers))
            if run.outcome[place] in (Outcome.FINISHED, Outcome.FAILED_SAFE):
                assert np.all(np.isfinite(numbers))
            else:
                assert np.isposinf(run.peak_drift[place]).all()


@pytest.mark.parametrize("channel", ["force", "deformation"])
def test_a_reading_that_is_no_number_sends_no_current(spec: ControlLawSpec, channel: str) -> None:
    loop = devices(rd1005())
    fault = Fault(channel=channel, index=1, start=0.05, end=0.1, value=np.nan)
    run = simulate_loop(
        five_storeys(), loop, law_of(spec, loop), [SHORT], Hardware(faults=(fault,)), histories=True
    )
    command = run.histories[0].command
    if run.outcome[0] == Outcome.FAILED_SAFE:
        np.testing.assert_array_equal(command[50:100, 1], 0.0)
    elif spec.name != "modulated_homogeneous_friction":
        # It reads nothing of the channel, or an observer keeps the state clear of such readings.
        without = simulate_loop(five_storeys(), loop, law_of(spec, loop), [SHORT], histories=True)
        np.testing.assert_array_equal(command, without.histories[0].command)
        assert run.outcome[0] == Outcome.FINISHED


@pytest.mark.parametrize("name", ["fuzzy", "inverse_network"])
def test_tables_that_a_law_cannot_read_are_refused(name: str) -> None:
    loop = devices(rd1005())
    law = law_with_gains(name, plant_with(loop))
    for table in law.tables:
        broken = replace(law, tables={**law.tables, table: np.ones(2)})
        refusal(simulate_loop, five_storeys(), loop, broken, [SHORT], match=f"table `(reach|{table})` of")


def test_gains_of_another_shape_or_name_are_refused(spec: ControlLawSpec) -> None:
    loop = devices(rd1005())
    law = law_of(spec, loop)
    refusal(replace, law, gains={**law.gains, "more": 1.0}, match="has no gain 'more'")
    for name, gain in law.gains.items():
        for wrong in (np.asarray(gain)[..., :-1], np.zeros((2, 3, *np.shape(gain)))):
            other = replace(law, gains={**law.gains, name: wrong})
            refusal(simulate_loop, five_storeys(), loop, other, [SHORT], match=f"^`{name}` of {spec.name}")
        left = {key: gain for key, gain in law.gains.items() if key != name}
        refusal(replace, law, gains=left, match=f"lacks the gain '{name}'")


@pytest.mark.parametrize("spec", [spec for spec in control_laws() if spec.needs_curve], ids=name_of)
def test_a_law_without_its_curve_is_refused(spec: ControlLawSpec) -> None:
    refusal(replace, law_of(spec, devices(rd1005())), curve=None, match="give it a `curve`")

"""The predictive rollout against its copy in NumPy, what it promises in its model, and what it refuses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from loop_samples import (
    LARGEST,
    believed,
    design_problem,
    devices,
    five_storeys,
    hysteretic,
    plant_with,
    rd1005,
    sweep,
)
from refusals import refusal

import mrwork as mr
from mrwork import Device
from mrwork.closed_loop import Fault, Hardware, LoopSample, Responses, UserLaw, simulate_loop
from mrwork.control import ControlLaw, LoopModel, design_law
from mrwork.control.laws.law_settings import design_candidates
from mrwork.dampers.simulation import Outcome
from tests.control.rollout_formula import Loops, RolloutInNumPy

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

SHORT = sweep(0.6)
# The copy takes milliseconds for a decision.
COPIED = mr.motions.trimmed(SHORT, end=0.35)
HOLD = 0.01
LATE = {"delay": 3.5e-3, "sample_time": 1e-3}
NOISY = {
    "feedback": "observer",
    "acceleration_noise": 0.05,
    "deformation_noise": 2e-5,
    "force_noise": 10.0,
    "ground_acceleration_noise": 0.02,
}


def rollout(
    model: LoopModel,
    *,
    delay: float = 0.0,
    step: float = 1e-3,
    correction: float = 0.5,
    horizon: float = 0.05,
    order: int = 4,
    residual: float = 0.0,
) -> ControlLaw:
    each = np.ones(len(model.devices))
    return ControlLaw(
        name="predictive_rollout",
        gains={
            "base": 0.5 * each,
            "tails": np.outer(each, [0.2, 1.0]),
            "levels": np.outer(each, [0.0, 0.15, 0.4, 0.8, LARGEST]),
            "drift_weight": np.array([2e-3**-2]),
            "acceleration_weight": np.array([3.0**-2]),
            "peak_weight": np.array([1.0]),
            "energy_weight": np.array([0.05]),
            "horizon": np.array([horizon]),
            "force_correction": np.array([correction]),
            "residual_weight": np.array([residual]),
        },
        tables={
            "timing": np.array([HOLD, step, delay, 0.1, 2.0]),
            "forecast": np.array([order, 0.998, 100.0]),
            "correction": np.array([0.5, 50.0]),
            "shears": np.array([0.0, 0.0, 1.0, 1.0]),
        },
        model=model,
    )


def in_numpy(law: ControlLaw, hardware: Hardware, steps: int) -> tuple[UserLaw, list[RolloutInNumPy]]:
    """The copy as a law in Python, for one run; a run that is repeated begins anew."""
    times = COPIED.dt * np.arange(COPIED.n_time)
    copies: list[RolloutInNumPy] = []

    def command(sample: LoopSample, memory: object) -> Floats:
        if sample.time == 0.0:
            copies.append(
                RolloutInNumPy(
                    law,
                    hardware.sample_time,
                    steps=steps,
                    preview=hardware.ground_preview,
                    shaking=lambda time: float(np.interp(time, times, COPIED.acceleration, right=0.0)),
                )
            )
        again = copies[-1]
        readings = (
            sample.deformation[0],
            sample.rate[0],
            sample.force[0],
            float(sample.ground_acceleration[0]),
            sample.acceleration[0],
        )
        return again.command(sample.displacement[0], sample.velocity[0], *readings)[None]

    return UserLaw(name="again", command=command), copies


def both(
    law: ControlLaw, loop: Sequence[Device], hardware: Hardware, steps: int, frame: mr.Building | None = None
) -> tuple[Responses, Responses]:
    again, _ = in_numpy(law, hardware, steps)
    return tuple(
        simulate_loop(frame or five_storeys(), loop, each, [COPIED], hardware, histories=True)
        for each in (law, again)
    )


def check_same(ours: mr.Responses, again: mr.Responses, tolerance: float) -> None:
    """The law in the core and its copy say the same, and move the command."""
    assert ours.outcome[0] == Outcome.FINISHED
    for name in ("command", "force", "drift", "acceleration"):
        expected = getattr(again.histories[0], name)
        least = tolerance * np.abs(expected).max()
        np.testing.assert_allclose(getattr(ours.histories[0], name), expected, rtol=tolerance, atol=least)
    assert len(np.unique(ours.histories[0].command)) > 2


@pytest.mark.parametrize(
    ("model", "step", "settings"),
    [
        (rd1005, 1e-3, {}),
        (rd1005, 1e-3, {**NOISY, "known_ground": True}),
        (rd1005, 1e-3, {**LATE, "ground_preview": 0.03}),
        (hysteretic, 5e-4, {**LATE, **NOISY}),
    ],
)
def test_the_law_is_its_copy_in_numpy(model, step, settings) -> None:
    loop = devices(model(), second=model is rd1005)
    law = rollout(stiffer(loop), delay=settings.get("delay", 0.0), step=step)
    ours, again = both(law, loop, Hardware(**settings), round(HOLD / step))
    check_same(ours, again, 1e-9)


def stiffer(loop: Sequence[Device]) -> LoopModel:
    """The loop that the law believes in: 5 % stiffer than it is, with other dampers."""
    frame = five_storeys()
    weaker = [
        replace(each, theta=np.asarray(each.theta) * ([0.9] + [1.0] * (np.size(each.theta) - 1)))
        for each in loop
    ]
    return LoopModel(building=replace(frame, stiffness=1.05 * frame.stiffness), devices=weaker)


# Of which every storey yields under the motion.
YIELDS = {"yield_drift": 3e-4, "post_yield_ratio": 0.05, "sharpness": 8.0}


def yielding(frame: mr.Building | None = None, **others: float) -> mr.Building:
    return mr.buildings.with_storeys_that_yield(frame or five_storeys(), **{**YIELDS, **others})


def believing(
    frame: mr.Building, loop: Sequence[Device], *, residual: float = 0.0, **shears: float
) -> ControlLaw:
    """A rollout with this model, and offsets, rate and limits of the adaptation."""
    given = {"offsets": 0.0, "rate": 0.0, "least": 0.6, "most": 1.6, **shears}
    law = rollout(LoopModel(building=frame, devices=loop), residual=residual)
    return replace(law, tables={**law.tables, "shears": np.array(list(given.values()))})


@pytest.mark.parametrize(
    ("model", "settings", "shears"),
    [
        (yielding(yield_drift=3.6e-4, post_yield_ratio=0.1), {}, {}),
        (yielding(yield_drift=3.6e-4), {**NOISY, "known_ground": True}, {"rate": 5.0}),
        (yielding(), LATE, {"offsets": 1.0}),
        (yielding(), {}, {"residual": 3e6}),
        (five_storeys(), {"acceleration_noise": 0.05}, {"offsets": 1.0}),
    ],
)
@pytest.mark.filterwarnings("ignore:.*observer")
def test_a_model_that_yields_is_its_copy_in_numpy(model, settings, shears) -> None:
    loop = devices(rd1005(), second=False)
    law = replace(believing(model, loop, **shears))
    law = replace(
        law, tables={**law.tables, "timing": np.array([HOLD, 1e-3, settings.get("delay", 0.0), 0.1, 2.0])}
    )
    ours, again = both(law, loop, Hardware(**settings), 10, yielding())
    check_same(ours, again, 1e-8)
    # The storeys yield: their loops have come to their ends.
    assert ours.peak_drift.max() > 2.0 * YIELDS["yield_drift"]


def followed(
    law: ControlLaw, frame: mr.Building, motion: mr.GroundMotion
) -> tuple[RolloutInNumPy, Floats, Floats]:
    """The copy after a run, its loops at all samples and those of the plant, shape (n_samples, n_elements)."""
    loop = devices(rd1005(), second=False)
    run = simulate_loop(frame, loop, law, [motion], histories=True).histories[0]
    copy, seen, n = RolloutInNumPy(law, 1e-3, steps=10), [], 5
    copy.decide = lambda q, v: None
    for number in range(len(run.time) - 1):
        readings = (run.deformation[number], run.rate[number], run.force[number])
        ground = float(run.ground_acceleration[number])
        copy.sent.append(run.command[number])
        state = run.state[number]
        copy.command(state[:n], state[n:], *readings, ground, run.acceleration[number])
        copy.sent.pop()
        seen.append(copy.states)
    loops = Loops(frame.elements)
    spring = np.array([each.stiffness for each in frame.elements])
    elongation = run.state[:-1, :n] @ loops.rows.T
    return copy, np.array(seen), (run.element_force[:-1] - spring * elongation) / loops.forces_at_yield


def test_the_loops_of_the_law_are_those_of_the_plant() -> None:
    frame = yielding()
    law = believing(frame, devices(rd1005(), second=False))
    _, ours, true = followed(law, frame, SHORT)
    assert np.abs(true).max() > 0.99
    # The path between samples is taken as straight.
    np.testing.assert_allclose(ours, true, atol=5e-3)


def test_the_prediction_is_the_plant_to_the_error_of_its_step() -> None:
    """Under a known ground, of a frame that yields, while the base command is held."""
    frame, loop, n = yielding(), devices(rd1005(), second=False), 5
    held = ControlLaw(name="passive", gains={"command": [0.5]})
    run = simulate_loop(frame, loop, held, [SHORT], histories=True).histories[0]
    times = SHORT.dt * np.arange(SHORT.n_time)
    errors = []
    for steps in (4, 8):
        copy = RolloutInNumPy(
            believing(frame, loop),
            1e-3,
            steps=steps,
            preview=1.0,
            shaking=lambda time: float(np.interp(time, times, SHORT.acceleration)),
        )
        seen: list[Floats] = []
        squares = copy.squares

        def spy(
            q: Floats, acceleration: Floats, ground: float, squares=squares, seen=seen
        ) -> tuple[Floats, Floats]:
            seen.append(np.atleast_2d(q)[0])
            return squares(q, acceleration, ground)

        copy.squares = spy
        largest = 0.0
        for number in range(300):
            seen.clear()
            state = run.state[number]
            readings = (run.deformation[number], run.rate[number], run.force[number])
            copy.command(
                state[:n], state[n:], *readings, run.ground_acceleration[number], run.acceleration[number]
            )
            copy.sent[-1] = np.array([0.5])
            if number % 10 == 0:
                # The motion now, then those at the steps of the base alone, of 50 ms.
                largest = max(largest, np.abs(seen[-1] - run.state[number + 50, :n]).max())
        errors.append(largest / np.abs(run.state[:, :n]).max())
    assert errors[0] < 0.02
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_adapted_yield_drifts_come_to_those_of_the_frame(factor: float) -> None:
    frame = yielding()
    law = believing(
        yielding(yield_drift=factor * YIELDS["yield_drift"]), devices(rd1005(), second=False), rate=20.0
    )
    copy, _, true = followed(law, frame, sweep(2.0, peak=3.0))
    yielded = np.abs(true).max(axis=0) > 0.99
    assert yielded.any()
    np.testing.assert_allclose(copy.loops.strength[yielded], 1.0 / factor, rtol=0.1)


def test_a_weight_of_the_residual_drift_lowers_it_and_leaves_an_elastic_model_as_it_is() -> None:
    loop = devices(rd1005(), second=False)
    motions = [
        mr.motions.scaled_to_peak(mr.synthetic_motion(duration=4.0, rng=seed), 3.0) for seed in range(3)
    ]
    left = []
    for frame, under in ((yielding(), motions), (five_storeys(), motions[:1])):
        with_weight, without = (
            simulate_loop(frame, loop, believing(frame, loop, residual=each), under) for each in (3e6, 0.0)
        )
        left.append([np.abs(each.residual_drift).max(axis=1).mean() for each in (with_weight, without)])
    assert left[0][0] < left[0][1]
    assert left[1][0] == left[1][1]
    refusal(
        design_law,
        "predictive_rollout",
        design_problem(),
        {**REFERENCES, "residual_weight": 1.0},
        match="residual_weight has no effect",
    )


def test_offsets_of_a_true_model_change_nothing() -> None:
    loop = devices(rd1005(), second=False)
    with_offsets, without = (
        simulate_loop(five_storeys(), loop, believing(five_storeys(), loop, offsets=each), [SHORT])
        for each in (1.0, 0.0)
    )
    np.testing.assert_allclose(with_offsets.peak_drift, without.peak_drift, rtol=1e-6)


def test_what_a_law_believes_is_a_frame_of_these_numbers() -> None:
    frame = mr.buildings.with_p_delta(yielding(height_of(five_storeys())))
    problem = replace(design_problem(), building=frame)
    settings = {
        **REFERENCES,
        "believed_stiffness": 1.1,
        "believed_yield_drift": 0.8,
        "believed_post_yield": 2.0,
    }
    model = design_law("predictive_rollout", problem, {**settings, "model": "building"}).model.building
    soft = replace(five_storeys(), stiffness=1.1 * five_storeys().stiffness)
    again = mr.buildings.with_p_delta(
        yielding(height_of(soft), yield_drift=0.8 * YIELDS["yield_drift"], post_yield_ratio=0.1)
    )
    np.testing.assert_allclose(model.site_stiffness, again.site_stiffness, rtol=1e-9)
    for ours, expected in zip(model.elements, again.elements, strict=True):
        np.testing.assert_allclose(ours.numbers, expected.numbers, rtol=1e-9)
    elastic = design_law("predictive_rollout", problem, settings).model.building
    assert not elastic.nonlinear
    np.testing.assert_array_equal(elastic.stiffness, soft.stiffness)


def height_of(frame: mr.Building) -> mr.Building:
    return replace(frame, heights=np.full(5, 3.0))


def test_an_elastic_model_has_the_references_of_the_elastic_frame() -> None:
    asked: list[bool] = []

    def peaks(elastic: bool) -> mr.control.ReferencePeaks:
        asked.append(elastic)
        return mr.control.ReferencePeaks(commands=(0.47,), drift=1.96e-3, acceleration=2.79)

    problem = replace(design_problem(reference_peaks=peaks), building=yielding())
    for model, words in (("elastic", "elastic frame"), ("building", "frame that yields")):
        law = design_law("predictive_rollout", problem, {"model": model})
        assert words in law.notes[0]
    assert asked == [True, False]


def test_candidates_of_other_beliefs_are_refused() -> None:
    problem = replace(design_problem(), building=yielding())
    many = [
        mr.control.settings_of("predictive_rollout", {**REFERENCES, "model": "building", **each})
        for each in ({}, {"horizon": 0.2}, {"believed_yield_drift": 0.9})
    ]
    found = design_candidates("predictive_rollout", problem, many)
    assert found.designed == (0, 1)
    assert "beliefs" in found.refusals[2]


def test_shears_that_floors_or_the_model_do_not_tell_are_refused() -> None:
    pair = devices(rd1005(), second=False)
    law = believing(five_storeys(), pair, rate=1.0)
    refusal(simulate_loop, five_storeys(), pair, law, [SHORT], match="storeys that yield")
    turned = mr.buildings.modal_truncation(five_storeys(), n_modes=5)
    loop = [replace(each, row=turned.storeys[0]) for each in pair]
    law = believing(turned, loop, offsets=1.0)
    refusal(simulate_loop, turned, loop, law, [SHORT], match="not the coordinates")


def test_a_command_without_a_lag_acts_at_once_in_the_copy_too() -> None:
    loop = devices(rd1005(lag="none"), second=False)
    law = rollout(stiffer(loop), delay=2e-3)
    ours, again = both(law, loop, Hardware(delay=2e-3), 10)
    np.testing.assert_allclose(ours.histories[0].command, again.histories[0].command, rtol=1e-9, atol=1e-9)


def test_no_decision_costs_more_in_the_model_than_the_base_alone() -> None:
    loop = devices(rd1005(), second=False)
    law = rollout(believed(plant_with(loop)))
    run = simulate_loop(five_storeys(), loop, law, [SHORT], histories=True).histories[0]
    again = RolloutInNumPy(law, 1e-3, steps=10)
    state, n = run.state, 5
    left = 0
    for number, sent in enumerate(run.command):
        ground = float(np.interp(number * 1e-3, SHORT.dt * np.arange(SHORT.n_time), SHORT.acceleration))
        again.command(
            state[number, :n],
            state[number, n:],
            run.deformation[number],
            run.rate[number],
            run.force[number],
            ground,
        )
        if number % 10 == 0:
            chosen = again.costs[np.isclose(again.trials[:, 0], sent[0], atol=1e-12)].min()
            assert chosen <= again.costs[0] * (1.0 + 1e-9)
            left += chosen < again.costs[0] * (1.0 - 1e-6)
    assert left > 20


def test_the_forecast_is_weighted_least_squares() -> None:
    loop = devices(rd1005(), second=False)
    copy = RolloutInNumPy(rollout(believed(plant_with(loop)), order=3), 1e-3, steps=10)
    readings = np.random.default_rng(4).normal(size=80).cumsum()
    for reading in readings:
        copy.learn(float(reading))
    padded = np.concatenate([np.zeros(3), readings])
    rows = np.array([padded[k : k + 3][::-1] for k in range(80)])
    weight = 0.998 ** np.arange(79, -1, -1)
    normal = rows.T @ (weight[:, None] * rows) + 0.998**80 / 100.0 * np.eye(3)
    np.testing.assert_allclose(copy.w, np.linalg.solve(normal, rows.T @ (weight * readings)), rtol=1e-8)


def test_a_preview_beyond_the_horizon_leaves_nothing_to_forecast() -> None:
    """The forecast that is taught by other readings sends the same commands, where it is not asked."""
    loop = devices(rd1005(), second=False)
    law = rollout(believed(plant_with(loop)))
    other = replace(law, tables={**law.tables, "forecast": np.array([7, 0.9, 3.0])})
    for preview, equal in ((0.2, True), (0.02, False)):
        sent = [
            simulate_loop(
                five_storeys(), loop, each, [SHORT], Hardware(ground_preview=preview), histories=True
            )
            .histories[0]
            .command
            for each in (law, other)
        ]
        assert np.array_equal(*sent) == equal


def test_a_still_ground_forecasts_a_still_ground() -> None:
    loop = devices(rd1005(), second=False)
    ours, again = both(rollout(believed(plant_with(loop)), order=0), loop, Hardware(), 10)
    np.testing.assert_allclose(ours.histories[0].command, again.histories[0].command, atol=1e-9)
    # Nothing is read of the ground.
    lost = Fault(channel="ground_acceleration", start=0.1, end=0.2, value=np.nan)
    law = rollout(believed(plant_with(loop)), order=0)
    deaf = simulate_loop(five_storeys(), loop, law, [COPIED], Hardware(faults=(lost,)), histories=True)
    np.testing.assert_array_equal(deaf.histories[0].command, ours.histories[0].command)


def test_a_reading_of_the_ground_that_is_no_number_sends_nothing_and_is_forgotten() -> None:
    loop = devices(rd1005(), second=False)
    lost = Fault(channel="ground_acceleration", start=0.1, end=0.15, value=np.nan)
    law = rollout(believed(plant_with(loop)))
    run = simulate_loop(five_storeys(), loop, law, [SHORT], Hardware(faults=(lost,)), histories=True)
    assert run.outcome[0] == Outcome.FAILED_SAFE
    np.testing.assert_array_equal(run.histories[0].command[100:150], 0.0)
    assert np.all(run.histories[0].command[160:].max() > 0.0)


REFERENCES = {"base": 0.47, "drift": 1.96e-3, "acceleration": 2.79}


def test_the_law_lowers_both_peaks_below_its_base() -> None:
    """On the average of some motions: without a plant that differs, with its default settings."""
    law = design_law("predictive_rollout", design_problem(), REFERENCES)
    pair = devices(rd1005(), second=False)
    motions = [
        mr.motions.scaled_to_peak(mr.synthetic_motion(duration=8.0, rng=seed), 0.981) for seed in range(6)
    ]
    held = ControlLaw(name="passive", gains={"command": [0.47]})
    ours, base = (simulate_loop(five_storeys(), pair, each, motions) for each in (law, held))
    assert np.all(ours.outcome == Outcome.FINISHED)
    for name in ("peak_drift", "peak_acceleration"):
        ratios = getattr(ours, name).max(axis=1) / getattr(base, name).max(axis=1)
        assert ratios.mean() < 0.97
    assert ours.energy_error.max() < 1e-6


def test_the_settings_that_a_law_leaves_out_are_those_of_the_problem() -> None:
    peaks = mr.control.ReferencePeaks(commands=(0.47,), drift=1.96e-3, acceleration=2.79)
    found = design_law("predictive_rollout", design_problem(reference_peaks=lambda _: peaks))
    given = design_law("predictive_rollout", design_problem(), REFERENCES)
    for name, gain in given.gains.items():
        np.testing.assert_array_equal(found.gains[name], gain)
    still = design_law("predictive_rollout", design_problem(), {**REFERENCES, "forecast": "zero"})
    assert still.tables["forecast"][0] == 0.0


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "no training motions to take it from"),
        ({**REFERENCES, "base": 3.0}, "1.88 at most"),
        ({**REFERENCES, "decision": 0.0105}, "whole number of samples"),
    ],
)
def test_a_design_that_cannot_be_is_told(settings: dict[str, float], words: str) -> None:
    refusal(design_law, "predictive_rollout", design_problem(), settings, match=words)


def test_a_model_that_is_missing_or_that_its_step_does_not_resolve_is_told() -> None:
    pair = devices(rd1005(), second=False)
    refusal(replace, rollout(believed(plant_with(pair))), model=None, match="give it a `model`")
    law = design_law("predictive_rollout", design_problem(), {**REFERENCES, "step": 5e-3})
    refusal(simulate_loop, five_storeys(), pair, law, [SHORT], match="finer `step`")
    law = design_law("predictive_rollout", design_problem(), REFERENCES)
    slow = Hardware(sample_time=4e-3)
    refusal(simulate_loop, five_storeys(), pair, law, [SHORT], slow, match="decides every 0.01 s")

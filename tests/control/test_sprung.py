"""Laws of absolute motion on a car, whose sprung mass is named: skyhook of the body, groundhook of the wheel."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from quarter_car import CAR, ROAD, quarter_car
from refusals import refusal

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.closed_loop import LoopSample, UserLaw
from mrwork.study.study import study_fingerprint

HARDWARE = mr.Hardware(sample_time=1e-3)


def damper(*, sprung: bool = True) -> mr.Device:
    car = quarter_car()
    return mr.Device(
        name="strut",
        spec=mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A"),
        theta=[50.0, 950.0, 0.02, 500.0, 0.0],
        row=car.storeys[1],
        largest_command=1.0,
        sprung=car.floors[1] if sprung else None,
    )


def run(law: mr.ControlLaw | UserLaw, device: mr.Device) -> mr.Responses:
    road = mr.motions.iso_8608_road("C", speed=20.0, rng=1, duration=5.0)
    return mr.simulate_loop(quarter_car(), [device], law, [road], HARDWARE, histories=True)


def in_python(rule: Callable[[Floats, Floats, Floats], Floats]) -> UserLaw:
    """A law on where the rule of absolute velocities of wheel and body and of the damper's rate is positive."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        # The ground velocity by the trapezoidal rule, which is exact for a piecewise linear acceleration.
        memory[:, 0] += 0.5e-3 * (memory[:, 1] + sample.ground_acceleration) * (sample.time > 0.0)
        memory[:, 1] = sample.ground_acceleration
        np.testing.assert_allclose(sample.ground_velocity, memory[:, 0], atol=1e-12)
        wheel, body = (sample.velocity + memory[:, :1]).T
        return np.where(rule(wheel, body, sample.rate[:, 0]) > 0.0, 1.0, 0.0)

    return UserLaw(name="in Python", command=command, n_memory=2)


def law(name: str, **gains: float) -> mr.ControlLaw:
    return mr.ControlLaw(name=name, gains={gain: [value] for gain, value in gains.items()})


@pytest.mark.parametrize(
    ("built_in", "rule"),
    [
        (law("mixed_skyhook", crossover=np.inf), lambda wheel, body, rate: body * rate),
        (law("skyhook_groundhook", share=1.0), lambda wheel, body, rate: body * rate),
        (law("skyhook_groundhook", share=0.0), lambda wheel, body, rate: -wheel * rate),
    ],
)
def test_a_law_of_a_sprung_mass_sends_the_commands_of_the_law_in_python(
    built_in: mr.ControlLaw, rule: Callable[[Floats, Floats, Floats], Floats]
) -> None:
    one, other = run(built_in, damper()), run(in_python(rule), damper())
    np.testing.assert_array_equal(one.histories[0].command, other.histories[0].command)
    np.testing.assert_array_equal(one.histories[0].drift, other.histories[0].drift)


def test_shares_of_skyhook_and_groundhook_add() -> None:
    commands = run(law("skyhook_groundhook", share=0.3), damper()).histories[0].command
    # Each of both is on or off.
    np.testing.assert_allclose(np.unique(commands.round(12)), [0.0, 0.3, 0.7, 1.0])


def test_skyhook_of_the_body_is_softer_than_passive_on_and_without_it_is_passive_on() -> None:
    def body(law: mr.ControlLaw, device: mr.Device) -> float:
        return float(run(law, device).rms_acceleration.ravel()[1])

    on, skyhook = law("passive", command=1.0), law("mixed_skyhook", crossover=np.inf)
    driven = law("acceleration_driven")
    assert body(skyhook, damper()) < 0.7 * body(on, damper())
    assert body(driven, damper()) < 0.65 * body(driven, damper(sprung=False))
    # It then reads the rate of the damper alone, which has one sign with itself.
    assert body(skyhook, damper(sprung=False)) == pytest.approx(body(on, damper()), rel=1e-9)


def test_the_sprung_mass_of_one_damper_leaves_the_other_as_it_is() -> None:
    building, theta = quarter_car(), [50.0, 950.0, 0.02, 500.0, 0.0]
    road = mr.motions.iso_8608_road("B", speed=20.0, rng=2, duration=2.0)
    spec = damper().spec
    tyre, strut = (
        mr.Device(name=name, spec=spec, theta=theta, row=row, largest_command=1.0)
        for name, row in zip(building.storey_names, building.storeys, strict=True)
    )
    bang_bang = law("decentralised_bang_bang")
    same = mr.Device(
        name="tyre", spec=spec, theta=theta, row=tyre.row, largest_command=1.0, sprung=building.storeys[0]
    )
    # A sprung mass whose row is that of the damper is none.
    without, with_row = (
        mr.simulate_loop(building, pair, bang_bang, [road], HARDWARE, histories=True).histories[0].command
        for pair in ([tyre, strut], [same, strut])
    )
    np.testing.assert_array_equal(with_row, without)


def study(folder: Path, controllers: str, sprung: str = 'sprung = "body"\n') -> Path:
    path = folder / "car.toml"
    path.write_text(f"{CAR}{sprung}{ROAD}{controllers}\n[hardware]\nsample_time = 0.001\n")
    return path


def test_a_study_names_the_sprung_mass(tmp_path: Path) -> None:
    skyhook = '[[controller]]\nlaw = "mixed_skyhook"\nsettings = { crossover = inf }\n'
    read = mr.read_study(study(tmp_path, skyhook))
    np.testing.assert_array_equal(read.devices[0].sprung, [0.0, 1.0])
    plain = mr.read_study(study(tmp_path, skyhook, ""))
    assert study_fingerprint(read) != study_fingerprint(plain)
    again = mr.read_study(read.to_toml(tmp_path / "again.toml"))
    assert study_fingerprint(again) == study_fingerprint(read)


@pytest.mark.parametrize(
    ("controllers", "sprung", "match"),
    [
        (
            '[[controller]]\nlaw = "passive_on"\n',
            'sprung = "body"\n',
            "line 1.: sprung has no effect on laws",
        ),
        ('[[controller]]\nlaw = "mixed_skyhook"\n', 'sprung = "roof"\n', "there is no floor 'roof'"),
        (
            '[[controller]]\nlaw = "skyhook_groundhook"\nsettings = { share = 0.5 }\n',
            "",
            'groundhook damps the unsprung mass.*sprung = "body"',
        ),
    ],
)
def test_a_sprung_mass_of_no_use_is_refused(
    tmp_path: Path, controllers: str, sprung: str, match: str
) -> None:
    refusal(mr.read_study, study(tmp_path, controllers, sprung), match=match)


def test_a_row_that_does_not_fit_is_refused() -> None:
    car, plain = quarter_car(), damper()
    for sprung in (np.ones(3), np.zeros(2)):
        wrong = mr.Device(
            name="strut",
            spec=plain.spec,
            theta=plain.theta,
            row=plain.row,
            largest_command=1.0,
            sprung=sprung,
        )
        road = mr.motions.iso_8608_road("B", speed=20.0, rng=2, duration=1.0)
        refusal(
            mr.simulate_loop,
            car,
            [wrong],
            law("acceleration_driven"),
            [road],
            HARDWARE,
            match="`sprung` has shape",
        )

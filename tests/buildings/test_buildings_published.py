"""Published buildings have their reported frequencies and damping."""

import numpy as np
import pytest
from refusals import refusal

from mrwork.buildings import Building, building, buildings


def of_two_masses(mass: float, lower: float, upper: float) -> list[float | None]:
    """Frequencies [Hz] of a frame of two equal masses, from its characteristic polynomial."""
    middle = (lower + 2.0 * upper) / (2.0 * mass)
    apart = np.sqrt(middle**2 - lower * upper / mass**2)
    return [float(np.sqrt(middle + side) / (2.0 * np.pi)) for side in (-apart, apart)]


# [Hz], with the digits of the sources.
REPORTED: dict[str, list[float | None]] = {
    "dyke1996": [5.46, 15.81, 23.64],
    "jansen2000": [1.388, None, None, None, None, 11.18],
    "uts": [3.00, 8.74, 13.76, 17.68, 20.21],
    "frame": [3.0],
    "sac3": [0.990, 3.061, 5.855],
    "utfpr": of_two_masses(24.3, 6820.0, 8220.0),
}
DIGITS = {"dyke1996": 0.005, "jansen2000": 0.005, "uts": 0.005, "frame": 1e-9, "sac3": 0.0005, "utfpr": 1e-9}


def test_every_building_has_a_reported_frequency_to_be_held_to() -> None:
    assert {known.name for known in buildings()} == set(REPORTED)


@pytest.mark.parametrize("name", REPORTED)
def test_frequencies_are_those_reported(name: str) -> None:
    frequencies = building(name).frequencies
    assert len(frequencies) == len(REPORTED[name])
    for ours, theirs in zip(frequencies, REPORTED[name], strict=True):
        assert theirs is None or abs(ours - theirs) <= DIGITS[name]


@pytest.mark.parametrize(
    ("name", "modes", "ratios"),
    [("jansen2000", range(6), 0.005), ("uts", (0, 2), 0.01), ("frame", (0,), 0.01), ("sac3", (0, 2), 0.02)],
)
def test_damping_ratios_are_those_reported(name: str, modes: range | tuple[int, ...], ratios: float) -> None:
    np.testing.assert_allclose(building(name).damping_ratios[list(modes)], ratios, rtol=1e-4)


@pytest.mark.parametrize("known", buildings(), ids=lambda known: known.name)
def test_moving_with_the_ground_moves_every_floor_alike_and_strains_the_first_storey_alone(
    known: Building,
) -> None:
    np.testing.assert_allclose(known.floors @ known.influence, 1.0)
    np.testing.assert_allclose(known.storeys @ known.influence, np.eye(len(known.storeys))[0])


def test_floors_of_the_sac_building_come_lowest_first() -> None:
    sac = building("sac3")
    # In the source the roof is heaviest, and it moves most in the first mode.
    assert sac.mass[2, 2] == 5.1779e5
    assert (np.diff(sac.floors @ sac.modes[:, 0]) > 0.0).all()


def test_a_name_that_is_not_published_is_refused_with_the_one_that_was_meant() -> None:
    refusal(building, "dyke", match="did you mean dyke1996")

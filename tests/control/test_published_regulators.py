"""Published weights give the regulator of the paper's own words."""

from __future__ import annotations

import numpy as np
from control_samples import five_storeys, plant
from sentences import Refused

from mrwork.control import accelerations, published_regulator, regulator_as_published, regulator_of_outputs


def test_weights_of_dyke_are_those_of_the_third_floor() -> None:
    system = plant()
    own = regulator_of_outputs(system, accelerations(system), [0.0, 0.0, 1.0], 1e-17)
    as_published = regulator_as_published(system, published_regulator("dyke1996"))
    np.testing.assert_array_equal(as_published.gain, own.gain)


def test_another_building_is_refused(refused: Refused) -> None:
    refused(regulator_as_published, plant(1, five_storeys()), published_regulator("dyke1996"))


def test_an_unknown_name_is_answered_by_those_that_exist(refused: Refused) -> None:
    refused(published_regulator, "dyke")

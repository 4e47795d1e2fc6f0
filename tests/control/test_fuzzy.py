"""The fuzzy table is Mamdani's inference, worked out."""

import numpy as np
import pytest

from mrwork.control.laws.fuzzy import INPUT_SETS, OUTPUT_SETS, RULES, fuzzy_table, infer, memberships


def test_sets_share_each_input_among_them() -> None:
    values = np.linspace(-2.0, 2.0, 401)
    np.testing.assert_allclose(memberships(values).sum(axis=-1), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(memberships([-1.0, 0.5, 7.0]).argmax(axis=-1), [0, 3, 4])


def test_at_the_centres_one_rule_speaks() -> None:
    centres = list(INPUT_SETS.values())
    expected = [[OUTPUT_SETS[consequent] for consequent in row] for row in RULES]
    np.testing.assert_allclose(infer(np.array(centres)[:, None], centres), expected, atol=1e-12)


def test_two_rules_balance_as_their_trapezia() -> None:
    """Deformation large, rate 0.9: VL holds to 0.8 and L to 0.2.

    A triangle of half width b cut at h has the area b h (2 - h). With b = 1/4 they overlap between 0.75 and 1, where
    the larger of the two counts: VL rises to 0.2 at 0.8, so L rules the flat part from 0.55 to 0.8.
    """
    b = 0.25
    whole = b * 0.8 * (2.0 - 0.8)  # VL about 1
    # Of L, what is not under VL: from 0.5 rising to 0.55, flat at 0.2 to 0.8, less the triangle of VL from 0.75 to 0.8.
    rising, flat, under = 0.5 * 0.05 * 0.2, 0.25 * 0.2, 0.5 * 0.05 * 0.2
    moment = (
        whole * 1.0 + rising * (0.5 + 0.05 * 2.0 / 3.0) + flat * 0.675 - under * (0.75 + 0.05 * 2.0 / 3.0)
    )
    # Its own trapezoidal rule of 1200 steps is the tolerance.
    np.testing.assert_allclose(infer(1.0, 0.9), moment / (whole + rising + flat - under), atol=1e-6)


def test_the_device_does_not_know_left_from_right() -> None:
    _, share = fuzzy_table()
    np.testing.assert_allclose(share, share[::-1, ::-1], atol=1e-12)


def test_it_yields_on_the_way_back_and_resists_on_the_way_out() -> None:
    way = np.linspace(0.05, 1.0, 20)
    assert np.all(infer(way, way) > infer(way, -way))
    assert infer(-1.0, 1.0) == pytest.approx(0.0, abs=1e-12)
    assert infer(2.0, 3.0) == pytest.approx(1.0, abs=1e-12)
    assert infer(0.0, 0.0) == pytest.approx(0.0, abs=1e-12)


def test_the_table_stands_for_the_inference_between_its_points() -> None:
    points, share = fuzzy_table()
    rng = np.random.default_rng(13)
    x, v = rng.uniform(-1.0, 1.0, (2, 500))
    step = points[1] - points[0]
    i, j = ((each + 1.0) // step for each in (x, v))
    i, j = np.minimum(i.astype(int), 39), np.minimum(j.astype(int), 39)
    p, q = (x - points[i]) / step, (v - points[j]) / step
    between = (
        (1 - p) * (1 - q) * share[i, j]
        + p * (1 - q) * share[i + 1, j]
        + (1 - p) * q * share[i, j + 1]
        + p * q * share[i + 1, j + 1]
    )
    assert np.abs(between - infer(x, v)).max() < 0.05
    assert np.sqrt(np.mean((between - infer(x, v)) ** 2)) < 0.01
    assert share.min() >= 0.0
    assert share.max() <= 1.0

"""The study of chapter 5 at few currents, on dampers whose truth is known; branches of loops."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import mrwork as mr
from mrwork.records import DamperTest, build_damper_test
from mrwork.search import EfficientGA, StopRules
from studies.chapter_5.damper_tests import FORCE_NOISE_N, RD_1005_3, TestSet, synthetic_sets
from studies.chapter_5.loop_branches import branches
from studies.chapter_5.outcome import STATIC, Fitting, SetOutcome, study_set
from studies.chapter_5.page import write_page
from studies.chapter_5.thickness_and_mean import compared, loops_table

FITTING = Fitting(search=EfficientGA(population=40, stop=StopRules(max_generations=40)), rng=1)
# Three are the fewest that a quadratic law can be found from.
CURRENTS = (0.5, 1.0, 1.5)
# The RMS of n white samples scatters by 1/sqrt(2 n), 2.2 % for the thousand here.
SCATTER = 0.1


@pytest.fixture(scope="module")
def sets() -> tuple[TestSet, ...]:
    return synthetic_sets(seed=1, currents=CURRENTS, frequencies=(1.0,))


@pytest.fixture(scope="module")
def static(sets: tuple[TestSet, ...]) -> SetOutcome:
    return study_set(sets[0], (STATIC,), FITTING)


def test_the_true_model_and_its_laws_are_recovered_within_their_errors(static: SetOutcome) -> None:
    each, laws = static.each[STATIC.label], static.laws[STATIC.label]
    names = mr.damper(STATIC.damper).names
    for name in STATIC.free:
        place = names.index(name)
        true = np.polynomial.polynomial.polyval(each.currents, RD_1005_3[name])
        assert np.all(abs(each.values[:, place] - true) < 5.0 * each.errors[:, place]), name
        deviation = np.subtract(laws.joint.coefficients[name], RD_1005_3[name])
        assert np.all(abs(deviation) < 5.0 * np.array(laws.joint.errors[name])), name
    for rms in (each.rms_n, laws.joint.rms_n, static.true_laws.rms_n):
        np.testing.assert_allclose(rms, FORCE_NOISE_N, rtol=SCATTER)
    # A law of as many numbers as currents passes through the values.
    for way in (laws.through, laws.weighted):
        values = each.values[:, names.index("alpha")]
        np.testing.assert_allclose(way.at("alpha", each.currents), values, rtol=1e-9)


def test_loops_of_the_true_model_differ_by_the_scatter_of_the_cycles(static: SetOutcome) -> None:
    loops = compared(static)
    for name, missed in loops.missed[STATIC.label].items():
        # The scatter is a standard error, found from three cycles.
        assert np.all(missed < 2.0 * loops.scatter[name]), name
    np.testing.assert_allclose(loops.models[STATIC.label].thickness, loops.tests.thickness, rtol=0.05)
    assert np.all(np.diff(loops.tests.thickness) > 0.0)
    assert len(loops_table(static).rows) == len(CURRENTS)
    each = static.each[STATIC.label]
    wrong = replace(static, each={STATIC.label: replace(each, fits=each.fits[::-1])})
    missed = compared(wrong).missed[STATIC.label]
    # The middle one is in its place.
    assert np.all(missed["thickness"][[0, 2]] > 0.2)
    assert np.all(missed["mean"][[0, 2]] > 0.2)


def test_the_page_stands_alone_and_calls_synthetic_data_synthetic(static: SetOutcome, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_page([static], page, skipped="Skipped: no records.", footer="Seed 1.")
    text = page.read_text(encoding="utf-8")
    assert '<span class="tag">synthetic</span>' in text
    assert not [each for each in ("measured", "$", 'src="', "url(http", "<link", "<script") if each in text]


AMPLITUDE, FREQUENCY, PER_CYCLE = 0.01, 1.0, 400
OMEGA = 2.0 * np.pi * FREQUENCY
DAMPING, STIFFNESS = 2000.0, 5000.0
TIME = np.arange(5 * PER_CYCLE + PER_CYCLE // 3) / (FREQUENCY * PER_CYCLE)
Floats = NDArray[np.float64]


def displacement(phase: float = 0.7) -> Floats:
    return np.asarray(AMPLITUDE * np.sin(OMEGA * TIME + phase))


def velocity(phase: float = 0.7) -> Floats:
    return np.asarray(AMPLITUDE * OMEGA * np.cos(OMEGA * TIME + phase))


def recorded(force: Floats, *, phase: float = 0.7, middle: float = 0.0) -> DamperTest:
    return build_damper_test(
        name="rig",
        time=TIME,
        displacement=middle + displacement(phase),
        velocity=velocity(phase),
        force=force,
        current=1.0,
    )


@pytest.mark.parametrize(("phase", "middle"), [(0.0, 0.0), (0.7, 0.02), (2.9, 0.0)])
def test_branches_split_a_loop_into_thickness_and_mean(phase: float, middle: float) -> None:
    test = recorded(STIFFNESS * displacement(phase) + DAMPING * velocity(phase), phase=phase, middle=middle)
    loop = branches(test)
    assert len(loop.thickness) == 4
    from_middle = np.sqrt(AMPLITUDE**2 - (loop.abscissa / OMEGA) ** 2)
    for thickness, mean in zip(loop.thickness, loop.mean, strict=True):
        # Close to the largest velocity, where the branches meet steeply, a chord between samples is no arc.
        np.testing.assert_allclose(thickness[2:-2], 2.0 * STIFFNESS * from_middle[2:-2], rtol=1e-3)
        np.testing.assert_allclose(mean, DAMPING * loop.abscissa, atol=1e-3 * DAMPING * AMPLITUDE * OMEGA)
    loop = branches(test, over="displacement")
    from_middle = loop.abscissa - loop.abscissa[loop.abscissa.size // 2]
    inner = abs(from_middle) < 0.9 * AMPLITUDE
    speed = OMEGA * np.sqrt(AMPLITUDE**2 - from_middle[inner] ** 2)
    np.testing.assert_allclose(loop.thickness.mean(axis=0)[inner], 2.0 * DAMPING * speed, rtol=0.01)

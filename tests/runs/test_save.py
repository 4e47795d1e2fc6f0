"""`mr.save` writes what Python has made as the folder of a verb, which `mr.load` reads back to the bit."""

from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from refusals import refusal
from report_samples import fit as sample_fit
from report_samples import prediction

import mrwork as mr
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.run_writer import RunAtWork


@pytest.fixture(scope="module")
def test() -> mr.DamperTest:
    return mr.synthetic_test("spencer1997")


@pytest.fixture(scope="module")
def fit(test: mr.DamperTest) -> mr.Fit:
    return mr.identify("bingham", test, rng=0)


@pytest.fixture(scope="module")
def draws(fit: mr.Fit, test: mr.DamperTest) -> mr.Draws:
    return mr.sample(fit, test, walkers=16, most_steps=40, threads=1)


def test_a_fit_and_its_draws_come_back_and_verbs_take_them(
    fit: mr.Fit, draws: mr.Draws, tmp_path: Path
) -> None:
    place = mr.save(fit, tmp_path / "run")
    read = mr.load(place, mr.StoredRun).fit
    assert (read.theta, read.fingerprint) == (fit.theta, fit.fingerprint)
    mr.save(draws, place)
    stored = mr.load(place, mr.StoredRun).draws
    assert stored is not None
    assert np.array_equal(stored.chains, draws.chains)
    assert mrwork("predict", place, "synthetic:spencer1997_slow", "--quiet").returncode == 0
    # It is one of `mrwork identify`, with additions.
    lost = RunAtWork(place, FIT_RUN).check_losses
    refusal(lost, match="would lose held_out.json, held_out.npz, posterior.nc, which")


def test_nothing_is_replaced_and_draws_belong_to_their_fit(
    fit: mr.Fit, draws: mr.Draws, test: mr.DamperTest, tmp_path: Path
) -> None:
    place = mr.save(fit, tmp_path / "run")
    refusal(mr.save, fit, place, match="has a run")
    mr.save(draws, place)
    refusal(mr.save, draws, place, match="has draws")
    other = mr.save(mr.identify("viscous_dahl", test, rng=0), tmp_path / "other")
    refusal(mr.save, draws, other, match="another fit")
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "notes.txt").write_text("mine")
    refusal(mr.save, fit, tmp_path / "files", match="not a run folder")
    mr.save(sample_fit(prediction()), tmp_path / "described")

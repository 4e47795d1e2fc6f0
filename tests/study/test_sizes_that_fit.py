"""What would not fit into memory is refused with an estimate, before anything is allocated."""

from __future__ import annotations

from pathlib import Path

import pytest

from mrwork.buildings import read_building, shear_building
from mrwork.dampers import damper
from mrwork.errors import SettingError
from mrwork.motions import synthetic_motion
from mrwork.uncertainty.planning.candidates import read_candidates


@pytest.mark.parametrize(("duration", "dt"), [(1e12, 0.01), (30.0, 1e-12), (1e100, 1e-100)])
def test_a_motion_of_too_many_samples_is_refused_with_its_size(duration: float, dt: float) -> None:
    with pytest.raises(SettingError, match=r"would have .* samples and take .* GB"):
        synthetic_motion(duration=duration, dt=dt)


def test_a_building_of_a_thousand_million_storeys_is_refused_with_its_size(tmp_path: Path) -> None:
    path = tmp_path / "tower.toml"
    path.write_text("masses = [1e3]\nstiffnesses = [1e6]\nn_storeys = 1_000_000_000\n")
    with pytest.raises(SettingError, match=r"tower\.toml.*1,000,000,000 storeys .* 8,000,000,000\.0 GB"):
        read_building(path)
    with pytest.raises(SettingError, match="5,000 storeys"):
        shear_building(name="tower", masses=[1e3] * 5000, stiffnesses=[1e6] * 5000)


def test_too_many_candidates_are_refused_with_their_size(tmp_path: Path) -> None:
    path = tmp_path / "candidates.csv"
    path.write_text("amplitude,frequency\n" + "0.01,1\n" * 20_000)
    with pytest.raises(SettingError, match=r"20,000 candidates of modified_bouc_wen would take .* GB"):
        read_candidates(path, damper("modified_bouc_wen"))

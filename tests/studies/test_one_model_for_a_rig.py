"""The study of one model for a rig: its settings are read, and each of its families is a model with its laws."""

from __future__ import annotations

import runpy
from pathlib import Path

STUDY = Path(__file__).parents[2] / "studies" / "one_model_for_a_rig" / "study.py"


def test_every_family_of_the_settings_follows_the_command() -> None:
    families = runpy.run_path(str(STUDY))["families"]()
    assert len(families) > 5
    for family in families.values():
        assert set(family.laws) == set(family.spec.following)

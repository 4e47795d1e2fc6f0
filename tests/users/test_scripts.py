"""Scripts as users write them run to their ends; `test_public_names.py` checks that they are typed."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPTS = sorted(path for path in Path(__file__).parent.glob("*.py") if not path.name.startswith("test_"))
# What a script must have found, beside that it ran to its end.
FOUND: dict[str, Callable[[dict[str, Any]], bool]] = {
    "sweep_candidates": lambda found: (
        found["forces"].shape == (2000, 1001) and np.isfinite(found["misfit"]).all()
    ),
    "fit_with_scipy": lambda found: abs(found["found"].fun / found["fit"].nrmse - 1.0) < 1e-3,
    "own_search": lambda found: found["theta"][3] == 0.0 and found["budgeted"].stop_reason == "target",
    "rank_parameters": lambda found: set(found["table"].index) == set(found["spec"].names),
    "tune_weights": lambda found: found["table"]["peak_drift"].shape == (400, 5),
    "figures_in_own_axes": lambda found: (
        found["shown"] == ["Force (N)", "Residual (N)", "Pseudo-acceleration (m/s²)"]
        and found["table"]["y"].shape == (50,)
    ),
    "read_runs_back": lambda found: found["found"] == f"a fit of {found['fit'].fit_percent:.1f} %",
    "identify_and_predict": lambda found: list(found["parameters"].index) == list(found["fit"].spec.names),
}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_of_a_user_runs_to_its_end(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert FOUND[script.stem](runpy.run_path(str(script)))

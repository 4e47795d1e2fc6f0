"""What the tests of run folders share."""

from pathlib import Path

import pytest
import verb_folders


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the commands that write run folders."""
    place = tmp_path_factory.mktemp("inputs")
    verb_folders.write_inputs(place)
    return place


@pytest.fixture(scope="session")
def runs(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of each verb that has --out, by its name, and a comparison of models; to be read only."""
    place = tmp_path_factory.mktemp("runs")
    verb_folders.write_runs(inputs, place)
    return place

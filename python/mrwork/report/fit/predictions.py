"""The tests that bands are calibrated on, with what was predicted for them, as they are kept in a run directory."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from mrwork.errors import OutputError, RecordError
from mrwork.records import DamperTest, Observation
from mrwork.report.run_directory import PREDICTIONS
from mrwork.uncertainty.bands.prediction import Prediction

_FACTS = (
    "name",
    "path",
    "sha256",
    "dt",
    "start_time",
    "n_settle",
    "velocity_source",
    "current",
    "voltage",
    "amplitude",
    "frequency",
    "synthetic",
)
_CHANNELS = ("displacement", "velocity", "force")


def write_predictions(place: Path, predictions: Sequence[Prediction]) -> None:
    """Keep predictions for the figures, in single precision.

    Raises
    ------
    OutputError
        Where they cannot be written.
    """
    facts = [
        {fact: getattr(each.test, fact) for fact in _FACTS} | {"observation": asdict(each.test.observation)}
        for each in predictions
    ]
    arrays = {
        f"{channel}_{number}": getattr(each.test, channel).astype(np.float32)
        for number, each in enumerate(predictions)
        for channel in _CHANNELS
    } | {f"model_{number}": each.model_force.astype(np.float32) for number, each in enumerate(predictions)}
    content = io.BytesIO()
    np.savez_compressed(content, facts=np.array(json.dumps(facts)), **arrays)
    target = place / PREDICTIONS
    beside = target.with_name(f".{PREDICTIONS}.new")
    try:
        beside.write_bytes(content.getvalue())
        beside.replace(target)
    except OSError as reason:
        raise OutputError(
            f"cannot write {target}: {reason.strerror}; make room, then repeat the verb"
        ) from reason
    finally:
        beside.unlink(missing_ok=True)


def read_predictions(place: Path) -> tuple[Prediction, ...]:
    """The predictions of a run directory; none where there are none.

    Raises
    ------
    RecordError
        Where they are damaged.
    """
    path = place / PREDICTIONS
    if not path.is_file():
        return ()
    try:
        with np.load(path, allow_pickle=False) as stored:
            facts = json.loads(str(stored["facts"]))
            return tuple(
                Prediction(
                    test=DamperTest(
                        **{fact: each[fact] for fact in _FACTS},
                        observation=Observation(**each["observation"]),
                        **{
                            channel: stored[f"{channel}_{number}"].astype(np.float64) for channel in _CHANNELS
                        },
                    ),
                    model_force=stored[f"model_{number}"].astype(np.float64),
                )
                for number, each in enumerate(facts)
            )
    except (OSError, ValueError, KeyError, TypeError) as reason:
        raise RecordError(f"{path} is damaged ({reason}); run `mrwork calibrate {place}` again") from None

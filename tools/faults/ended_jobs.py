"""The jobs of `endings.py`, and what of their files must be the same whenever they end."""

from __future__ import annotations

import io
import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sinusoidal_tests import MOTIONS, sinusoidal_test
from tuning_samples import TWO_STOREYS, motion, study_file

from mrwork.store.child_reader import read_members

RUN = "run"
# Facts of the day and of the machine.
_VOLATILE = frozenset(
    {
        "folder",
        "seconds",
        "search_seconds",
        "created",
        "created_at",
        "command",
        "crc32",
        "outside",
        "candidates_per_second",
        "share_outside",
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A command: what is there before it, an earlier run of another seed, and the files of its result."""

    name: str
    words: tuple[str, ...]
    former: tuple[str, ...]
    results: tuple[str, ...]
    base: tuple[tuple[str, ...], ...] = ()
    resume: tuple[str, ...] = ("--resume",)
    # Bytes that a run writes at most.
    needs: int = 2_000_000
    # Where a run that was interrupted says so.
    manifest: bool = False
    # Commands that another process may not run meanwhile.
    rivals: tuple[tuple[str, ...], ...] = ()
    # CPU seconds after which the folder is locked.
    locked: float = 1.2

    def prepare(self, folder: Path) -> None:
        """Write the inputs."""
        seed = 0
        for motion_of in MOTIONS[:2]:
            for current in (0.0, 0.5, 1.0):
                force = 200.0 + 960.0 * current - 480.0 * current**2
                theta = (800.0, force, 2000.0, 20.0)
                test = sinusoidal_test("viscous_dahl", theta, motion_of, noise=0.02, rng=seed, cycles=5)
                columns = (test.time, 1e3 * test.displacement, test.force)
                rows = "\n".join(
                    f"{t:.6f},{x:.6f},{f:.4f},{current:g}" for t, x, f in zip(*columns, strict=True)
                )
                (folder / f"test{seed}.csv").write_text(f"t_s,displacement_mm,force_N,current_A\n{rows}\n")
                seed += 1
        study_file(
            folder,
            building=TWO_STOREYS,
            motions="".join(motion(name, number, use) for number, (name, use) in enumerate(_MOTIONS)),
            more='\n[[controller]]\nlaw = "clipped_optimal"\n[controller.settings]\ncontrol_weight = 1e-13\n',
        )

    def partial(self, folder: Path) -> bool:
        """Whether the run folder says that it is of an interrupted run."""
        path = folder / RUN / "manifest.json"
        return self.manifest and path.is_file() and json.loads(path.read_text())["status"] == "interrupted"

    def pending(self, folder: Path) -> bool:
        """Whether a journal waits to be continued."""
        return any(folder.rglob("*.part"))

    def leftovers(self, folder: Path) -> list[str]:
        """Files of writers that have ended."""
        return [
            str(path.relative_to(folder))
            for path in folder.rglob("*")
            if path.name.endswith((".part", ".new", ".copying")) or path.name == "copying"
        ]


_MOTIONS = (("A", "training"), ("B", "test"), ("C", ""), ("D", ""))
_PLAIN = ("identify", "test0.csv", "test3.csv", "--model", "viscous_dahl", "--every", "2", "--threads", "1")
_LAWS = tuple(f"test{number}.csv" for number in range(6))
_OUT = ("--threads", "1", "--out", RUN)
_FITTED = ((*_PLAIN, "--out", RUN),)
_SAMPLE = ("sample", RUN, "--walkers", "16", "--steps", "200", "--threads", "1")


def _addition(verb: str, *words: str) -> tuple[str, ...]:
    return (verb, RUN, *words, "--threads", "1")


JOBS = (
    Job(
        name="identify",
        words=("identify", "test0.csv", "test3.csv", "--model", "bouc_wen", *_OUT),
        former=(*_PLAIN, "--out", RUN),
        results=("fit.json", "journal.jsonl"),
        manifest=True,
        rivals=(
            ("identify", "test0.csv", "test3.csv", "--model", "bouc_wen", *_OUT),
            ("identify", "test0.csv", "test3.csv", "--model", "bouc_wen", *_OUT, "--resume"),
        ),
    ),
    Job(
        name="sample",
        words=(*_SAMPLE, "--seed", "1"),
        former=(*_SAMPLE, "--steps", "20"),
        base=_FITTED,
        results=("fit.json", "posterior.jsonl", "posterior.nc"),
        rivals=((*_SAMPLE, "--seed", "1"), (*_SAMPLE, "--seed", "1", "--resume"), _FITTED[0]),
    ),
    Job(
        name="laws",
        words=("identify", *_LAWS, "--model", "viscous_dahl", "--law", "k_w=quadratic", *_OUT),
        former=(*_PLAIN, "--out", RUN),
        results=("fit.json", "journal.jsonl"),
        manifest=True,
        rivals=(("identify", *_LAWS, "--model", "viscous_dahl", "--law", "k_w=quadratic", *_OUT),),
    ),
    Job(
        name="all",
        words=(
            "identify",
            "test0.csv",
            "test3.csv",
            "--every",
            "2",
            "--model",
            "bingham,dahl,viscous_dahl",
            *_OUT,
        ),
        former=(*_PLAIN, "--out", RUN),
        results=("fit.json", "ranking.json", "models/*/fit.json"),
        manifest=True,
        rivals=(
            ("identify", "test0.csv", "test3.csv", "--every", "2", "--model", "bingham,dahl", *_OUT),
            (*_PLAIN, "--out", RUN),
        ),
    ),
    Job(
        name="calibrate",
        words=_addition("calibrate"),
        former=_addition("calibrate", "test1.csv"),
        base=_FITTED,
        results=("fit.json", "calibration.json", "predictions.npz"),
        resume=(),
        rivals=(_addition("calibrate"), _addition("calibrate", "test1.csv"), _FITTED[0]),
    ),
    Job(
        name="profile",
        words=_addition("profile"),
        former=_addition("profile", "--level", "0.9"),
        base=_FITTED,
        results=("fit.json", "profiles.json"),
        resume=(),
        rivals=(_addition("profile"), _FITTED[0]),
    ),
    Job(
        name="plan",
        words=_addition("plan"),
        former=_addition("plan", "--seed", "3"),
        base=_FITTED,
        results=("fit.json", "plan.json"),
        resume=(),
        rivals=(_addition("plan"), _FITTED[0]),
    ),
    Job(
        name="respond",
        words=("respond", "study.toml", "--motions", "all", "--check-step", *_OUT),
        former=("respond", "study.toml", "--seed", "3", *_OUT),
        results=("results.json", "journal.jsonl", "study.toml", "histories/*"),
        manifest=True,
        rivals=(("respond", "study.toml", *_OUT), ("respond", "study.toml", *_OUT, "--resume")),
    ),
    Job(
        name="tune",
        words=("tune", "study.toml", *_OUT),
        former=("tune", "study.toml", "--quick", "--seed", "3", *_OUT),
        results=("*.json", "chosen.toml", "journal.jsonl"),
        manifest=True,
        rivals=(("tune", "study.toml", *_OUT), ("respond", "study.toml", *_OUT)),
    ),
)


def written_results(folder: Path, job: Job) -> dict[str, object]:
    """The contents of the files of a result, without facts of the day."""
    place = folder / RUN
    return {
        str(path.relative_to(place)): _content(path)
        for pattern in job.results
        for path in sorted(place.glob(pattern))
        if path.name != "manifest.json"
    }


def same_results(found: dict[str, object], wanted: dict[str, object]) -> list[str]:
    """In what two results differ."""
    names = sorted(found.keys() | wanted.keys())
    return [
        difference for name in names for difference in _differences(name, found.get(name), wanted.get(name))
    ][:3]


def _differences(where: str, found: object, wanted: object) -> list[str]:
    if found == wanted:
        return []
    if found is None or wanted is None:
        return [f"{where} is {'missing' if found is None else 'new'}"]
    if isinstance(found, dict) and isinstance(wanted, dict):
        keys = sorted(found.keys() | wanted.keys())
        return [
            each for key in keys for each in _differences(f"{where}.{key}", found.get(key), wanted.get(key))
        ]
    if isinstance(found, list) and isinstance(wanted, list) and len(found) == len(wanted):
        pairs = zip(found, wanted, strict=True)
        return [
            each for number, pair in enumerate(pairs) for each in _differences(f"{where}.{number}", *pair)
        ]
    return [f"{where} is {str(found)[:60]} where {str(wanted)[:60]} is right"]


def _content(path: Path) -> object:
    content = path.read_bytes()
    if path.suffix == ".json":
        return _lasting(json.loads(content))
    if path.suffix == ".jsonl":
        return [_lasting(json.loads(line)) for line in content.splitlines()]
    if path.suffix == ".toml":
        return _lasting(tomllib.loads(content.decode()))
    if path.suffix == ".npz":
        with np.load(io.BytesIO(content)) as arrays:
            return {name: (arrays[name].dtype.str, arrays[name].tobytes()) for name in arrays.files}
    if path.suffix == ".nc":
        return {
            name: (
                None if member.array is None else member.array.tobytes(),
                _lasting({key: str(value) for key, value in member.attributes.items()}),
            )
            for name, member in read_members(content, "hdf5").items()
        }
    return content


def _lasting(value: object) -> object:
    if isinstance(value, dict):
        return {key: _lasting(each) for key, each in value.items() if key not in _VOLATILE}
    return [_lasting(each) for each in value] if isinstance(value, list) else value

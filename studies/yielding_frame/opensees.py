"""The same frame in OpenSees: zero-length elements as storeys, steps of Newmark's average acceleration."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

import mrwork as mr
from studies.former.arrays import Floats
from studies.yielding_frame.frame import (
    DAMPER,
    GRAVITY,
    HEIGHT,
    MASSES,
    SAMPLE,
    STIFFNESSES,
    YIELD_DRIFT,
    Case,
    Histories,
    elastic_frame,
)

FLOORS = range(1, len(MASSES) + 1)
_P_DELTA, _DAMPER = 100, 200
# Largest change of a displacement in the last iteration of a step [m].
_TOLERANCE, _ITERATIONS = 1e-10, 50


def openseespy() -> Any | None:
    """The module, `None` where it is not installed or one of its libraries is missing."""
    try:
        return importlib.import_module("openseespy.opensees")
    except (ImportError, RuntimeError):
        return None


def build(ops: Any, case: Case) -> None:
    """Make the model with its motion, ready for `analyze`."""
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(0, 0.0)
    ops.fix(0, 1)
    for floor, mass in zip(FLOORS, MASSES, strict=True):
        ops.node(floor, 0.0, "-mass", mass)
    for floor, stiffness in zip(FLOORS, STIFFNESSES, strict=True):
        _storey(ops, case, floor, stiffness)
        ops.element("zeroLength", floor, floor - 1, floor, "-mat", floor, "-dir", 1, "-doRayleigh", 1)
        if case.p_delta:
            weight = GRAVITY * sum(MASSES[floor - 1 :])
            ops.uniaxialMaterial("Elastic", _P_DELTA + floor, -weight / HEIGHT)
            ops.element("zeroLength", _P_DELTA + floor, floor - 1, floor, "-mat", _P_DELTA + floor, "-dir", 1)
    if case.damper:
        material, dashpot = mr.dampers.opensees_from_bouc_wen(DAMPER)
        _bouc_wen(ops, _DAMPER, material)
        ops.uniaxialMaterial("Elastic", _DAMPER + 1, 0.0, dashpot)
        ops.element("zeroLength", _DAMPER, 0, 1, "-mat", _DAMPER, _DAMPER + 1, "-dir", 1, 1)
    frame = elastic_frame()
    # C = a0 M + a1 K, of the two corners of K and M that no other entry is mixed into.
    a1 = frame.damping[0, 1] / frame.stiffness[0, 1]
    a0 = (frame.damping[0, 0] - a1 * frame.stiffness[0, 0]) / MASSES[0]
    ops.rayleigh(a0, 0.0, a1, 0.0)
    ops.timeSeries("Path", 1, "-dt", case.motion.dt, "-values", *case.motion.acceleration.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", _TOLERANCE, _ITERATIONS)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")


def _storey(ops: Any, case: Case, tag: int, stiffness: float) -> None:
    """The material of a storey: elastic, bilinear or with the knee of the loop."""
    if case.elastic:
        ops.uniaxialMaterial("Elastic", tag, stiffness)
    elif not np.isfinite(case.sharpness) and case.ratio:
        ops.uniaxialMaterial("Steel01", tag, stiffness * YIELD_DRIFT, stiffness, case.ratio)
    elif not np.isfinite(case.sharpness):
        ops.uniaxialMaterial("ElasticPP", tag, stiffness, YIELD_DRIFT)
    else:
        half = 0.5 / YIELD_DRIFT**case.sharpness
        _bouc_wen(
            ops,
            tag,
            mr.dampers.OpenSeesBoucWen(
                alpha=case.ratio, ko=stiffness, n=case.sharpness, gamma=half, beta=half, Ao=1.0
            ),
        )


def _bouc_wen(ops: Any, tag: int, material: mr.dampers.OpenSeesBoucWen) -> None:
    m = material
    numbers = m.alpha, m.ko, m.n, m.gamma, m.beta, m.Ao, m.deltaA, m.deltaNu, m.deltaEta
    ops.uniaxialMaterial("BoucWen", tag, *numbers, 1e-14, 100)


def theirs(ops: Any, case: Case, step: float) -> Histories:
    """Histories of a case from OpenSees with steps of `step` [s], at all samples but the first."""
    build(ops, case)
    steps, samples = round(SAMPLE / step), round(case.motion.duration / SAMPLE) - 1
    found = np.empty((3, samples, len(MASSES)))
    for sample in range(samples):
        _advance(ops, steps, step)
        found[:, sample] = [
            [ops.nodeDisp(floor, 1) for floor in FLOORS],
            [ops.eleResponse(floor, "material", 1, "stress")[0] for floor in FLOORS],
            [ops.nodeAccel(floor, 1) for floor in FLOORS],
        ]
    ops.wipe()
    displacement, shear, acceleration = found
    time = SAMPLE * np.arange(1, samples + 1)
    ground = np.interp(
        time, case.motion.dt * np.arange(len(case.motion.acceleration)), case.motion.acceleration
    )
    drift = np.diff(displacement, axis=1, prepend=0.0)
    return Histories(drift=drift, shear=shear, acceleration=acceleration + ground[:, None])


def peak_drifts(ops: Any, case: Case, step: float, file: Path) -> Floats:
    """Peak drift of each storey [m], shape (6,), in one call of `analyze`; OpenSees writes it to `file`."""
    build(ops, case)
    ops.recorder("EnvelopeElement", "-file", str(file), "-precision", 12, "-ele", *FLOORS, "deformation")
    _advance(ops, round(case.motion.duration / step), step)
    ops.wipe()
    return np.asarray(np.loadtxt(file)[2])


def _advance(ops: Any, steps: int, step: float) -> None:
    if ops.analyze(steps, step):
        raise RuntimeError(f"OpenSees did not converge at {ops.getTime():.4g} s")

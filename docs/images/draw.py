"""Draws the picture of README.md and the first page: a damper with its prediction band, and a building with its peaks.

    python docs/images/draw.py

Everything is computed, with fixed seeds, in a few seconds; `overview.png` is written beside this file.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import mrwork as mr

PLACE = Path(__file__).parent
BLUE, ORANGE, GREY, GREEN = "#2a6fb0", "#d9822b", "#8a8f98", "#2f9e6e"


def draw_damper(ax: Axes) -> None:
    """A held-out cycle of the sample rig, predicted from other tests, with a band calibrated on further ones."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "mrwork", "init", "rig", f"{folder}/rig"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        fitted, calibration, held_out = (
            mr.read_damper_tests(f"{folder}/rig", use=use) for use in ("fit", "calibration", "test")
        )
    spec = mr.damper("viscous_dahl").with_current_laws({"k_w": "quadratic", "k_x": "linear"}, unit="A")
    fit = mr.identify(spec, fitted, rng=1)
    bands = mr.calibrate([mr.predict(fit, test) for test in calibration], held_out="are held out")
    prediction = mr.predict(fit, held_out[0])
    band = bands.band(prediction, 0.9)
    test = prediction.test
    last = slice(-round(1 / 1.2 / test.dt), None)
    displacement = 1e3 * test.displacement[last]
    ax.plot(
        displacement, 1e-3 * prediction.measured[last], ".", color=GREY, markersize=2.5, label="held-out test"
    )
    ax.plot(displacement, 1e-3 * prediction.force[last], color=BLUE, linewidth=1.6, label="prediction")
    for edge, label in ((band.lower, None), (band.upper, "90 % band")):
        ax.plot(displacement, 1e-3 * edge[last], color=ORANGE, linewidth=0.8, label=label)
    ax.set(xlabel="displacement [mm]", ylabel="force [kN]", title="A damper, from its tests")
    ax.legend(frameon=False, loc="center", fontsize=8)


def draw_building(ax: Axes) -> None:
    """Peak drifts of five storeys under the mean of eight motions."""
    frame = mr.building("uts")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    pair = mr.Device(
        name="pair",
        spec=preset.spec,
        theta=preset.theta,
        row=frame.storeys[0],
        largest_command=1.88,
        differential=True,
    )
    plant = mr.control.plant_of(frame, [pair.row])
    designs = mr.control.regulators_of_weights(plant, [plant.energy], np.geomspace(1e-9, 1e-5, 60))
    gains = [each.gain for each in designs]
    motions = [mr.synthetic_motion(rng=seed, peak=0.98) for seed in range(8)]
    hardware = mr.Hardware(sample_time=1e-3, delay=1e-3)

    def mean_drifts(law: mr.ControlLaw) -> np.ndarray:
        peaks = mr.simulate_loop(frame, [pair], law, motions, hardware).to_xarray()["peak_drift"]
        return peaks.mean(("motion", "realisation")).values

    constants = mean_drifts(
        mr.ControlLaw(name="passive", gains={"command": np.linspace(0.0, 1.88, 20)[:, None]})
    )
    laws = mean_drifts(mr.ControlLaw(name="clipped_optimal", gains={"gain": gains}))
    rows = (
        ("passive-off (i = 0)", constants[0], GREY),
        ("passive-on", constants[-1], GREEN),
        ("optimal passive", constants[constants.max(axis=1).argmin()], ORANGE),
        ("clipped-optimal", laws[laws.max(axis=1).argmin()], BLUE),
    )
    storeys = np.arange(1, len(frame.storeys) + 1)
    for label, drifts, colour in rows:
        ax.plot(1e3 * drifts, storeys, "o-", color=colour, linewidth=1.6, markersize=4, label=label)
    ax.set(xlabel="peak storey drift [mm]", ylabel="storey", title="A building, with it", yticks=storeys)
    ax.set_xlim(left=0)
    ax.legend(frameon=False, fontsize=8)


def main() -> None:
    """Draw the picture."""
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 9, "savefig.dpi": 180}):
        figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
        draw_damper(left)
        draw_building(right)
        for ax in (left, right):
            ax.spines[["top", "right"]].set_visible(False)
        figure.savefig(PLACE / "overview.png")


if __name__ == "__main__":
    main()

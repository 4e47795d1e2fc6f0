"""Two hundred regulators of a frame under two motions: peak drifts by candidate and storey."""

import numpy as np

import mrwork as mr

frame = mr.building("uts")
preset = mr.damper("static_hysteretic").preset("kwok2006")
damper = mr.Device(
    name="pair", spec=preset.spec, theta=preset.theta, row=frame.storeys[0], largest_command=1.88
)
plant = mr.control.plant_of(frame, damper.row)
designs = mr.control.regulators_of_weights(plant, [plant.energy], np.geomspace(1e-9, 1e-5, 200))
gains = [each.gain for each in designs if not isinstance(each, Exception)]
law = mr.ControlLaw(name="clipped_optimal", gains={"gain": gains})
motions = [mr.synthetic_motion(rng=seed, duration=2.0, peak=3.0) for seed in (1, 2)]
responses = mr.simulate_loop(frame, [damper], law, motions)
drift = responses.to_xarray()["peak_drift"].max("storey").mean(["motion", "realisation"])
table = responses.to_pandas()
print(int(drift.argmin("candidate")), responses.over_axes("peak_drift").shape, table["peak_drift"].shape)

"""Results as arrays with names, axes and units: every axis of every type survives in xarray and in pandas."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import study_samples
from plotted_results import draws, front, profiles, responses
from posterior_samples import MODEL, small_fit, small_test
from refusals import refusal
from run_folders import choice_of_laws, ranking_of_two, write_fit

import mrwork as mr
from mrwork.base.labelled import WithAxes
from mrwork.store.codec import json_document
from mrwork.store.run_folder import DRAWS, PROFILES, RANKING
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.posterior.draws import draws_content

RUN = ("candidate", "motion", "realisation")
STUDY = ("row", "motion", "realisation")
# For each type: how one is made, the axes of the rows of its table, and the axes of some of its arrays.
TYPES: dict[str, tuple[Callable[[], Any], tuple[str, ...], dict[str, tuple[str, ...]]]] = {
    "fit": (
        small_fit,
        ("parameter",),
        {"value": ("parameter",), "rmse_n": ("test",), "search_best": ("generation",)},
    ),
    "test": (
        lambda: replace(small_test(), current=0.5),
        ("time",),
        {"force": ("time",), "current": ("time",)},
    ),
    "prediction": (
        lambda: mr.predict(small_fit(), small_test()),
        ("time",),
        {"model_force": ("time",), "residual": ("time",), "force": ("time",)},
    ),
    "draws": (draws, ("walker", "draw"), {"log_posterior": ("walker", "draw"), "k_w": ("walker", "draw")}),
    "profiles": (profiles, ("parameter", "point"), {"ratio": ("parameter", "point")}),
    "profile": (lambda: profiles().profiles[0], ("point",), {"misfit": ("point",)}),
    "ranking": (lambda: ranking_of_two(MODEL), ("candidate",), {"left_out_percent": ("candidate",)}),
    "choice": (
        lambda: mr.Choice(ranking=ranking_of_two(MODEL), fits=()),
        ("candidate",),
        {"left_out_percent": ("candidate",)},
    ),
    "choice of laws": (lambda: choice_of_laws(MODEL), ("candidate",), {"law_c": ("candidate",)}),
    "responses": (
        responses,
        RUN,
        {"peak_drift": (*RUN, "storey"), "peak_force": (*RUN, "device"), "peak_base_shear": RUN},
    ),
    "history": (
        lambda: responses(1.0, 1.1).histories[0],  # type: ignore[index] # histories were asked for
        ("time",),
        {"drift": ("time", "storey"), "force": ("time", "device"), "input_energy": ("time",)},
    ),
    "criteria of a study": (lambda: study_samples.results().criteria_of_runs, STUDY, {"peak_drift": STUDY}),
    "quantities of a study": (
        lambda: study_samples.results().quantities,
        STUDY,
        {"peak_drift": (*STUDY, "storey"), "peak_force": (*STUDY, "device"), "outcome": STUDY},
    ),
    "front": (front, ("point",), {"train": ("point", "objective")}),
    "fragilities": (
        lambda: mr.fragility(study_samples.incremental(), {"peak_drift": "20 mm"}),
        ("row", "intensity"),
        {"reached": ("row", "intensity"), "response": ("row", "record", "intensity")},
    ),
    "sensitivities": (
        lambda: mr.sensitivities("bingham", np.tile(mr.damper("bingham").nominal, (2, 1)), small_test()),
        ("candidate", "time"),
        {"jacobian": ("candidate", "time", "parameter"), "force": ("candidate", "time")},
    ),
}


@pytest.mark.parametrize("kind", TYPES)
def test_every_axis_survives_with_names_units_and_words(kind: str) -> None:
    made, rows, declared = TYPES[kind]
    value: WithAxes = made()
    source = value._named_arrays()
    found, table = value.to_xarray(), value.to_pandas()
    assert {name: found[name].dims for name in declared} == declared
    assert tuple(table.index.names) == rows
    assert set(found.sizes) == set(source.labels)
    for name, array in source.arrays.items():
        assert found[name].dims == array.axes
        assert np.array_equal(found[name].values, array.values, equal_nan=array.values.dtype.kind == "f")
        assert found[name].attrs == array.attributes
        assert array.long_name, name
    for axis, labels in source.labels.items():
        assert found[axis].values.tolist() == labels.values.tolist()
    # Passive elements, of which there may be none, have no columns then.
    wide = {
        name: each for name, each in source.arrays.items() if set(rows) <= set(each.axes) and each.values.size
    }
    assert set(table.columns.get_level_values(0)) >= set(wide)
    for name, array in wide.items():
        own = [axis for axis in array.axes if axis not in rows]
        at_last = found[name].isel(dict.fromkeys(rows, -1)).values
        cells = np.atleast_1d(table[name].iloc[-1])
        assert np.array_equal(cells, at_last.reshape(-1), equal_nan=at_last.dtype.kind == "f")
        for axis in own:
            assert table[name].columns.tolist() == source.labels[axis].values.tolist()
        assert table.attrs["units"].get(name, "") == array.unit


def test_a_quantity_keeps_its_axes_without_reshaping_by_hand() -> None:
    found = responses(1.0, 1.1)
    drift = found.over_axes("peak_drift")
    assert drift.shape == (3, 2, 2, 5)
    labelled = found.to_xarray()["peak_drift"]
    assert np.array_equal(labelled.values, drift)
    run = np.ravel_multi_index((2, 1, 0), found.shape)
    assert np.array_equal(found.peak_drift[run], labelled.sel(candidate=2, motion="motion 2", realisation=0))
    assert labelled.attrs == {"units": "m", "long_name": "peak drift"}
    assert found.to_xarray()["peak_current"].attrs["units"] == "A"
    assert found.to_pandas()["peak_force"].columns.tolist() == [each.name for each in found.devices]
    refusal(found.over_axes, "peak_drft", match="did you mean peak_drift")
    alike = replace(found, motions=("synthetic", "synthetic"))
    assert alike.to_xarray()["motion"].values.tolist() == [0, 1]


def test_a_loaded_run_is_whole_and_the_same_when_loaded_twice(tmp_path: Path) -> None:
    fit, found = small_fit(), draws()
    place = tmp_path / "run"
    write_fit(place, fit)
    contents = {
        DRAWS: draws_content(found),
        PROFILES: json_document(asdict(profiles())).encode(),
        RANKING: json_document(asdict(ranking_of_two(MODEL))).encode(),
    }
    add_to_run(place, contents)
    once, twice = mr.load(place), mr.load(place)
    for run in (once, twice):
        assert run.draws is not None
        assert run.profiles is not None
        assert run.ranking is not None
        for saved, loaded in (
            (found, run.draws),
            (profiles(), run.profiles),
            (ranking_of_two(MODEL), run.ranking),
        ):
            assert loaded.to_xarray().identical(saved.to_xarray())
    assert once.fit.to_xarray().identical(twice.fit.to_xarray())
    assert once.fit.to_pandas().equals(twice.fit.to_pandas())
    saved = fit.to_xarray()
    assert np.array_equal(once.fit.to_xarray()["value"], saved["value"])
    assert set(once.fit.to_xarray().sizes) == set(saved.sizes)

"""Results as a MATLAB file of version 5: structs whose arrays have their unit and words beside them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.labelled import NamedArray, NamedArrays
from mrwork.errors import MrworkError, MrworkWarning
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.uncertainty.bands.prediction import predict_tests

_LONGEST = 63
# MATLAB's `iskeyword`.
_KEYWORDS = frozenset({
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
})  # fmt: skip


def matlab_names(names: Iterable[str]) -> dict[str, str]:
    """Valid and distinct MATLAB name of each name: letters, digits and underscores, first a letter, at most 63."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        valid = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if not re.match(r"[A-Za-z]", valid) or valid in _KEYWORDS:
            valid = f"x{valid}"
        stem, number = valid[:_LONGEST], 1
        valid = stem
        while valid in taken:
            number += 1
            end = f"_{number}"
            valid = f"{stem[: _LONGEST - len(end)]}{end}"
        taken.add(valid)
        found[name] = valid
    return found


def matlab_of_fit(fit: Fit, place: Path | None) -> bytes:
    """Parameters, laws and, of a run folder, the tests with their measured and simulated forces."""
    spec = fit.spec
    parameters = {
        each.name: {
            "name": each.name,
            "value": each.value,
            "unit": each.unit,
            "standard_error": np.nan if each.error is None else each.error,
            "lower": each.lower,
            "upper": each.upper,
            "verdict": each.verdict,
            "reason": each.reason,
            "tie": each.tie,
            "remark": estimate.remark,
        }
        for each, estimate in zip(fit.parameters.values(), fit.estimates, strict=True)
    }
    content: dict[str, Any] = {
        "title": f"Fit of {fit.model}",
        "model": fit.model,
        "equation": spec.equation,
        "status": fit.status,
        "fit_percent": fit.fit_percent,
        "rmse": {"value": fit.rmse_n, "unit": "N"},
        "theta": np.array(fit.theta),
        "theta_names": _cells(spec.names),
        "theta_units": _cells([each.unit for each in spec.parameters]),
        "parameters": _renamed(parameters),
    }
    if spec.current is not None:
        laws = {
            plain.name: {
                "law": law,
                "parameters": _cells(
                    [each.name for each in spec.parameters if each.plain_name == plain.name]
                ),
            }
            for plain, law in zip(spec.plain, spec.current.laws, strict=True)
        }
        content["laws"] = _renamed(laws)
        content["command_unit"] = spec.current.unit
    if place is not None:
        content["tests"] = _tests(place)
    return _file(content)


def matlab_of_groups(title: str, groups: Mapping[str, NamedArrays]) -> bytes:
    """Groups of arrays, each a struct."""
    structs = {name: _group(each) for name, each in groups.items()}
    return _file({"title": title, **_renamed(structs)})


def _tests(place: Path) -> Any:
    try:
        opened = reopen(place)
    except MrworkError as reason:
        warnings.warn(f"the file has no tests with their forces: {reason}", MrworkWarning, stacklevel=5)
        return _cells([])
    predictions = predict_tests(opened.fit, opened.tests)
    return _cells([{"name": each.test.label, **_group(each._named_arrays())} for each in predictions])


def _group(arrays: NamedArrays) -> dict[str, Any]:
    """A struct with the labels along each axis, and with every array."""
    labels = {name: _array(name, each, ()) for name, each in arrays.labels.items()}
    own = {name: _array(name, each, each.axes) for name, each in {**arrays.along, **arrays.arrays}.items()}
    return {"title": arrays.title, "labels": _renamed(labels), **_renamed(own)}


def _array(name: str, array: NamedArray, axes: tuple[str, ...]) -> dict[str, Any]:
    values = array.values
    texts = values.dtype.kind not in "biuf"
    struct: dict[str, Any] = {
        "name": name,
        "values": _cells(values) if texts else values,
        "unit": array.unit,
        "words": array.long_name,
    }
    return {**struct, "axes": _cells(axes)} if axes else struct


def _renamed(content: Mapping[str, Any]) -> dict[str, Any]:
    return {valid: content[name] for name, valid in matlab_names(content).items()}


def _cells(values: Any) -> Any:
    """A cell array, of the shape of an array, or a column of a list."""
    if isinstance(values, np.ndarray):
        return values.astype(object)
    cells = np.empty(len(values), dtype=object)
    cells[:] = list(values)
    return cells


def _file(content: Mapping[str, Any]) -> bytes:
    # A quarter of a second.
    from scipy.io import savemat

    stream = BytesIO()
    savemat(
        stream,  # type: ignore[arg-type] # the stubs know no streams
        dict(content),
        long_field_names=True,
        oned_as="column",
        do_compression=True,
    )
    return stream.getvalue()

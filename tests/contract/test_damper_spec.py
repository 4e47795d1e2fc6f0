"""What every damper model says of itself is complete and consistent."""

import math
import re

from mrwork import _rust
from mrwork.base.units import unit_of
from mrwork.dampers import damper_models

FLOPS_CEILING = 500


def test_names_are_unique_identifiers():
    names = [spec.name for spec in damper_models()]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() and name == name.lower() for name in names)


def test_prose_and_sources_are_given(spec):
    for text in (spec.title, spec.equation, spec.description, spec.source, spec.nominal_source):
        assert text.strip()
        assert "  " not in text, "a continued line left its indentation behind"
    assert re.search(r"\b(19|20)\d\d\b", spec.source)
    assert "verified" in spec.nominal_source


def test_parameter_names_are_unique_identifiers(spec):
    assert len(set(spec.names)) == len(spec.names) > 0
    assert all(name.isidentifier() for name in spec.names)


def test_every_parameter_is_in_the_equation_and_described(spec):
    for parameter in spec.parameters:
        assert re.search(rf"(?<![A-Za-z0-9_]){re.escape(parameter.name)}(?![A-Za-z0-9_])", spec.equation)
        assert parameter.description.strip()


def test_units_are_known_and_bounds_enclose_the_nominal_value_and_fit_the_scale(spec):
    for parameter in spec.parameters:
        # Of SI, so that a search finds the size of the parameter; one depends on the exponent of its model.
        assert parameter.unit == "m^-n" or unit_of(parameter.unit).factor == 1.0
        assert all(map(math.isfinite, (parameter.lower, parameter.nominal, parameter.upper)))
        assert parameter.lower < parameter.nominal < parameter.upper
        assert parameter.lower > 0.0 or parameter.scale != "log"
        assert parameter.lower < 0.0 < parameter.upper or parameter.scale != "offset"


def test_an_equation_of_motion_is_given_for_each_state(spec):
    rates = re.findall(r"^\s*\w+'\s*=", spec.equation, flags=re.MULTILINE)
    assert len(rates) == spec.n_states
    assert re.search(r"^\s*f\s*=", spec.equation, flags=re.MULTILINE)


def test_step_is_cheap(spec):
    # Counted, not timed: beyond this a search takes several times as long as with any other model.
    assert 0 < _rust.flops_per_step(spec.name, spec.nominal) < FLOPS_CEILING

"""The contracts run over the registry: a model that is listed is tested, without an edit here."""

import pytest
from compiled import release_compiled
from damper_samples import MOTIONS

from mrwork.dampers import damper_models


def n_params(spec):
    return len(spec.parameters)


@pytest.fixture(params=sorted(damper_models(), key=n_params), ids=lambda spec: spec.name, scope="module")
def spec(request, compiled_for):
    """Every registered damper model in turn: all tests of a module for one, then for the next."""
    if compiled_for != [n_params(request.param)]:
        # What JAX has compiled is of use to models with as many parameters, and else only takes memory.
        compiled_for[:] = [n_params(request.param)]
        release_compiled()
    return request.param


@pytest.fixture(scope="session")
def compiled_for():
    """Number of parameters of the models for which JAX has compiled functions."""
    return []


@pytest.fixture(params=MOTIONS)
def motion(request):
    """Every kind of loading in turn."""
    return MOTIONS[request.param]()

"""The contracts run over the registry: a model that is listed is tested, without an edit here."""

from __future__ import annotations

import pytest
from damper_samples import MOTIONS

from mrwork import _rust
from mrwork.dampers.spec import damper_models

INSTRUCTION_SET = "MRWORK_INSTRUCTION_SET"


@pytest.fixture(params=damper_models(), ids=lambda spec: spec.name)
def spec(request):
    """Every registered damper model in turn."""
    return request.param


@pytest.fixture(params=MOTIONS)
def motion(request):
    """Every kind of loading in turn."""
    return MOTIONS[request.param]()


@pytest.fixture(params=["avx512", "avx2", "plain"])
def instruction_set(request, monkeypatch):
    """Every instruction set that this machine has, in force for the test."""
    monkeypatch.setenv(INSTRUCTION_SET, request.param)
    try:
        _rust.instruction_set()
    except ValueError as error:
        pytest.skip(str(error))
    return request.param

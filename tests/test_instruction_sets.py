"""Which vector instructions this build and this machine have, and what is said where some lie idle."""

import os
import sys

import pytest
from command_line import ran

import mrwork as mr
from mrwork import _rust
from mrwork.dampers.simulation import InstructionSets


def test_simulations_run_on_the_fastest_set_of_build_and_machine():
    found = mr.instruction_set()
    usable = [name for name in found.built if name in found.machine]
    assert found.used == usable[0]
    assert found.machine[-1] == "plain"


def test_a_faster_set_that_was_left_out_is_named_with_what_builds_it():
    found = InstructionSets(used="avx2", built=("avx2",), machine=("avx512", "avx2", "plain"))
    assert found.faster == ("avx512",)
    for told in (str(found), repr(found)):
        assert "avx512" in told
        assert "MRWORK_BUILD_SETS=all" in told


@pytest.mark.parametrize("built", [("avx2",), ("avx512", "avx2", "plain")])
def test_a_build_with_the_best_set_of_a_machine_leaves_out_nothing_worth_telling(built):
    whole = InstructionSets(used="avx2", built=built, machine=("avx2", "plain"))
    assert not whole.faster
    assert "MRWORK_BUILD_SETS" not in str(whole)


def test_the_version_is_told_with_the_instruction_sets():
    told = ran(sys.executable, "-m", "mrwork", "--version", check=True).stdout.splitlines()
    assert told == [f"mrwork {mr.__version__}", str(mr.instruction_set())]


@pytest.mark.skipif(
    "avx2" not in _rust.instruction_sets()[1], reason="this machine has no vectors to lie idle"
)
def test_a_build_with_vectors_says_nothing_when_it_is_loaded():
    if _rust.instruction_set() == "plain" and not os.environ.get("MRWORK_INSTRUCTION_SET"):
        pytest.skip("this build has the plain set alone")
    done = ran(sys.executable, "-W", "error", "-c", "from mrwork import _rust", check=True)
    assert not done.stderr


@pytest.mark.parametrize("name", ["avx512", "avx2"])
def test_a_set_that_cannot_be_used_is_refused_in_a_sentence(name, monkeypatch):
    built, machine = _rust.instruction_sets()
    if name in built and name in machine:
        pytest.skip(f"{name} can be used here")
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", name)
    with pytest.raises(mr.errors.SettingError, match="MRWORK_INSTRUCTION_SET is") as refusal:
        mr.instruction_set()
    assert ("MRWORK_BUILD_SETS=all" in str(refusal.value)) == (name in machine)

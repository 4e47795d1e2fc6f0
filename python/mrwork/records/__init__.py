"""Damper test records: read them, check them, bring them to SI."""

from __future__ import annotations

from mrwork.records.build import build_damper_test
from mrwork.records.columns import parse_column_option
from mrwork.records.damper_test import DamperTest, Finding
from mrwork.records.observation import AS_IT_IS, Observation
from mrwork.records.read import read_damper_test, read_damper_tests

__all__ = [
    "AS_IT_IS",
    "DamperTest",
    "Finding",
    "Observation",
    "build_damper_test",
    "parse_column_option",
    "read_damper_test",
    "read_damper_tests",
]

"""Damper test records: read them, check them, bring them to SI."""

from __future__ import annotations

from mrwork.records.build import build_damper_test
from mrwork.records.columns import parse_column_option
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.detectors.labels import mislabelled
from mrwork.records.detectors.smoothing import Smoothing, detect_smoothing
from mrwork.records.observation import AS_IT_IS, Observation
from mrwork.records.read import read_damper_test, read_damper_tests
from mrwork.records.repair import repair

__all__ = [
    "AS_IT_IS",
    "DamperTest",
    "Finding",
    "Measured",
    "Observation",
    "Smoothing",
    "build_damper_test",
    "detect_smoothing",
    "mislabelled",
    "parse_column_option",
    "read_damper_test",
    "read_damper_tests",
    "repair",
]

"""Joint fits that describe some tests far worse than their own fits do."""

from __future__ import annotations

import numpy as np

from mrwork.identification.multistart import far_worse, far_worse_sentence
from mrwork.synthetic import synthetic_test


def test_a_test_is_far_worse_above_five_times_its_own_misfit_which_noise_limits() -> None:
    alone = np.array([0.04, 0.04, 0.001, np.nan])
    assert far_worse(np.array([0.19, 0.21, 0.09, 0.9]), alone).tolist() == [1]
    # Two percent is noise: a test that is described perfectly alone accuses nothing below ten.
    assert far_worse(np.array([0.1, 0.1, 0.11, 0.9]), alone).tolist() == [2]


def test_the_sentence_names_the_tests_and_what_to_do() -> None:
    tests = [synthetic_test("rd1005_1a")] * 5
    joint, alone = np.full(5, 0.3), np.full(5, 0.04)
    worse = far_worse(joint, alone)
    suspected = far_worse_sentence(tests, worse, joint, alone, found_again=False)
    assert suspected.startswith("false minimum suspected: 5 of 5 tests")
    assert "(70.0 % for 96.0 %)" in suspected
    assert "and 2 more" in suspected
    assert "try another seed" in suspected
    limited = far_worse_sentence(tests, worse, joint, alone, found_again=True)
    assert "these laws of this model cannot follow the tests" in limited
    for sentence in (suspected, limited):
        assert "--law auto" in sentence
        assert "compare other models (--model A,B)" in sentence
    assert "false minimum" not in limited

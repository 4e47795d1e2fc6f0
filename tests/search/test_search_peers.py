"""Optimisers of other libraries: what is different about them."""

from __future__ import annotations

import numpy as np
import pytest
from search_problems import optimiser_named, sphere
from sentences import Refused

from mrwork.search import PEERS, library


@pytest.mark.parametrize("name", PEERS)
def test_a_library_can_be_told_once(name, refused: Refused):
    peer = optimiser_named(name)
    state = peer.start(2, rng=0)
    proposal = peer.ask(state)
    assert np.array_equal(peer.ask(state).unit, proposal.unit)
    peer.tell(state, proposal, sphere(proposal.unit))
    refused(peer.tell, state, proposal, sphere(proposal.unit))


@pytest.mark.parametrize("name", PEERS)
def test_a_library_leaves_the_random_numbers_of_others_alone(name):
    peer = optimiser_named(name)
    # The one generator that all of NumPy shares is the very one meant here.
    np.random.seed(5)  # noqa: NPY002 - the global state is what is looked at
    before = np.random.get_state()[1].tobytes()  # noqa: NPY002 - the global state is what is looked at
    state = peer.start(2, rng=0)
    for _ in range(3):
        proposal = peer.ask(state)
        state = peer.tell(state, proposal, sphere(proposal.unit))
    assert np.random.get_state()[1].tobytes() == before  # noqa: NPY002 - the global state is what is looked at


def test_a_library_that_is_not_installed_is_named_with_the_remedy(refused: Refused):
    refused(library, "no_such_library.module")

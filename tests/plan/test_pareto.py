"""The Pareto optimal set against its definition."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from infoplan.plan import pareto_optimal

# Few distinct values make ties and duplicates common.
values = st.one_of(st.integers(0, 3).map(float), st.floats(-1e6, 1e6))


@st.composite
def vector_sets(draw):
    objectives = draw(st.integers(1, 4))
    vector = st.lists(values, min_size=objectives, max_size=objectives)
    vectors = draw(st.lists(vector, min_size=1, max_size=9))
    repeated = draw(st.lists(st.sampled_from(vectors), max_size=3))
    return np.array(vectors + repeated)


def improves(a, b):
    """Whether going from b to a gains in an objective without hurting another."""
    return min(a - b) >= 0 and max(a - b) > 0


@settings(max_examples=300, deadline=None)
@given(vectors=vector_sets())
def test_mask_is_the_definition(vectors):
    expected = [not any(improves(other, vector) for other in vectors) for vector in vectors]
    assert pareto_optimal(vectors).tolist() == expected


@settings(max_examples=100, deadline=None)
@given(vectors=vector_sets())
def test_one_objective_is_the_argmax_with_its_ties(vectors):
    first = np.ascontiguousarray(vectors[:, :1])
    assert pareto_optimal(first).tolist() == (vectors[:, 0] == vectors[:, 0].max()).tolist()


def test_by_hand():
    vectors = np.array([[3.0, 1.0], [1.0, 3.0], [2.0, 2.0], [2.0, 1.0], [3.0, 1.0], [1.0, 2.5]])
    assert pareto_optimal(vectors).tolist() == [True, True, True, False, True, False]

"""Answers of a method, made for the tests of its scores."""

import numpy as np
from hypothesis import strategies as st


def answers(probabilities, most):
    """One to `most` rows (is it visible?, probability), of a few probabilities."""
    row = st.tuples(st.booleans(), st.sampled_from(probabilities))
    return st.lists(row, min_size=1, max_size=most)


def columns(rows):
    """Labels and probabilities of such rows."""
    labels, probability = zip(*rows, strict=True)
    return np.array(labels), np.array(probability)

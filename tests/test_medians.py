"""The median of few numbers."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ridgefeature.medians import median


@given(st.lists(st.floats(allow_infinity=False, width=32), min_size=1, max_size=40))
def test_it_is_numpys_to_the_last_bit_and_changes_nothing(values: list[float]) -> None:
    array = np.array(values)
    before = array.copy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = float(np.median(array))
    for given_as in (array, values):
        found = median(given_as)
        assert found == expected or (math.isnan(found) and math.isnan(expected))
    np.testing.assert_array_equal(array, before)


def test_of_no_numbers_it_is_nan_and_of_a_table_that_of_all() -> None:
    assert math.isnan(median([]))
    assert median(np.array([[1, 9], [2, 3]])) == 2.5


@pytest.mark.parametrize("whole", [True, False])
def test_it_takes_what_is_read_only_or_no_number_of_its_own_type(whole: bool) -> None:
    values = np.arange(5) if whole else np.arange(5) < 3
    values.setflags(write=False)
    assert median(values) == np.median(values)

"""Points put in order by their coordinates, and some of them chosen evenly."""

import numpy as np
from numba import njit

from .grid import Floats, Ints

_FEW = 32
"""Points of a cell up to which all pairs are compared to sort them."""


@njit(cache=True)
def sort_rows(rows: Floats, first: int, last: int) -> None:
    """Sort rows[first:last] by x, then y, then z, in place (Shell sort: short runs, no worst case of n^2)."""
    gap = 1
    while gap < (last - first) // 8:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(first + gap, last):
            x, j = rows[i, 0], i - gap
            if rows[j, 0] < x:
                continue
            y, z = rows[i, 1], rows[i, 2]
            while j >= first and (
                rows[j, 0] > x
                or (rows[j, 0] == x and (rows[j, 1] > y or (rows[j, 1] == y and rows[j, 2] > z)))
            ):
                rows[j + gap, 0], rows[j + gap, 1], rows[j + gap, 2] = rows[j, 0], rows[j, 1], rows[j, 2]
                j -= gap
            rows[j + gap, 0], rows[j + gap, 1], rows[j + gap, 2] = x, y, z
        gap //= 3


@njit(cache=True)
def ordered(cell: Floats, k: int, order: Ints) -> None:
    """Order the first k columns of cell (3, n) by x, then y, then z: their numbers, into order."""
    if k > _FEW:
        rows = np.empty((k, 3))
        for i in range(k):
            rows[i, 0], rows[i, 1], rows[i, 2] = cell[0, i], cell[1, i], cell[2, i]
        sort_rows(rows, 0, k)
        for i in range(k):
            cell[0, i], cell[1, i], cell[2, i] = rows[i, 0], rows[i, 1], rows[i, 2]
            order[i] = i
        return
    # Free of branches that cannot be foretold: faster than any sort, of so few.
    for i in range(k):
        x, place, same = cell[0, i], 0, 0
        for j in range(k):
            place += cell[0, j] < x
            same += cell[0, j] == x
        if same > 1:
            for j in range(k):
                if cell[0, j] == x and j != i:
                    alike = cell[1, j] == cell[1, i]
                    less = cell[1, j] < cell[1, i] or (alike and cell[2, j] < cell[2, i])
                    place += less or (alike and cell[2, j] == cell[2, i] and j < i)
        order[place] = i


@njit(cache=True)
def chosen_row(block: int, every: int) -> int:
    """The row that is chosen of a block of so many; its place in the block goes by the golden ratio.

    Multiples of that are spread evenly, and points of a regular scan are not chosen in stripes.
    """
    return block * every + (((block * 2654435769) & 0xFFFFFFFF) * every >> 32)

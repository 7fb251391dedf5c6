"""Where several processes test, two compile half of the kernels each, instead of all of them everything.

Tests that start Python do so with -P: what is imported then is what is installed, and compiled by then.
"""

from __future__ import annotations

import gc
import os

import pytest


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    # What is imported stays for good: not to be looked through again whenever garbage is collected.
    gc.freeze()
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw1":
        from warm_kernels import compile_late_kernels

        compile_late_kernels()

"""Where several processes test, two compile half of the kernels each, instead of all of them everything."""

from __future__ import annotations

import os

import pytest


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw1":
        from warm_kernels import compile_late_kernels

        compile_late_kernels()

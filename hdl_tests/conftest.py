"""What the tests of the Verilog share with the others."""

from tool_paths import pytest_runtest_setup, pytest_unconfigure  # noqa: F401

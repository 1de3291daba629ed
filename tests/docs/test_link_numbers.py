"""What an upload takes, against what it may take; docs/upload.md has the figures."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from building import REPOSITORY


@pytest.fixture(scope="module")
def link() -> ModuleType:
    """The benchmark, which is no package."""
    spec = importlib.util.spec_from_file_location("link_benchmark", REPOSITORY / "benchmarks" / "link.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.common
def test_the_line_is_used(link: ModuleType) -> None:
    """In virtual time: the same on every machine."""
    scan, other = link.example()
    tables, words = other.image("table"), other.image("fourier")
    slow, fast = link.rate(scan, tables, 115200, 0.001), link.rate(scan, tables, 460800, 0.016)
    assert slow.payload >= 0.92
    assert fast.wire >= 0.85
    assert 8 * link.rate(scan, words, 115200, 0.001).wire_bytes <= slow.wire_bytes


@pytest.mark.rest
def test_a_scan_of_fourier_words_is_soon_in_force(link: ModuleType, tmp_path: Path) -> None:
    scan, other = link.example()
    part, image = link.PARTS[0], other.image("fourier")
    work = link.count(part.core, image, tmp_path)
    assert work.commit <= 1_000_000
    assert work.most <= 450_000, "the rendering of one axis, in one call"
    assert max(link.until_in_force(scan, image, part, link.device_s(part, work))) <= 0.150

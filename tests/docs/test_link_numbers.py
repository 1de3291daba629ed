"""What an upload takes, against what it may take; docs/upload.md has the figures."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from building import REPOSITORY
from replacing import replace


def benchmark(name: str) -> ModuleType:
    """A benchmark, which is no package."""
    spec = importlib.util.spec_from_file_location(f"{name}_benchmark", REPOSITORY / "benchmarks" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def link() -> ModuleType:
    """What an upload takes."""
    return benchmark("link")


@pytest.mark.common
def test_long_ways_slow_lines_and_lost_frames_cost_what_the_page_says() -> None:
    """In virtual time: the same on every machine. Of the lines that lose frames some uploads."""
    slow = benchmark("slow_link")
    scan = slow.PreparedScan.of_plan(slow.make_plan(slow.load(slow.EXAMPLE)))
    page = (REPOSITORY / "docs" / "upload.md").read_text("utf-8")
    for way in slow.WAYS:
        if way.uploads == 1:
            found = slow.cost(scan, way)
            assert slow.row(way, found) in page
            assert found.proportion < 2.0
        else:
            assert f"| {way.name} | " in page
    fifteen = next(way for way in slow.WAYS if way.lose == 0.15)
    some = slow.cost(scan, replace(fifteen, uploads=12))
    assert (some.finished, some.mean < 2.0) == (12, True)


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

"""The time from a key of ``tablegen live`` to the first line of the preview and of the exact scan, and their bytes.

``python benchmarks/live.py`` moves the shipped example on a virtual line of 115200 baud, without its ``[limits]`` and
with them: the client and the plans are the real ones, and the device is the model. The time of the host is the
processor time of this computer, without that of the model; the time of the line is virtual, and has the wait for the
start of a line.

``python benchmarks/live.py --angle 30`` prints the errors of previews of the example at an angle, on an operator of
plays: by that operator, in percent of the size; then the same times as without it, of moves at that angle.
"""

import argparse
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests" / "helpers"))  # the line and the device are those of the tests

from client_line import VirtualLine  # noqa: E402
from client_rig import client, info_for, model  # noqa: E402
from replacing import replace  # noqa: E402
from turned_scans import turned_setup, write_turned  # noqa: E402

from tablegen.api.live import Live  # noqa: E402
from tablegen.config.load import load  # noqa: E402
from tablegen.link.messages import SPLINE_DEGREE, DeviceInfo, Feature, More  # noqa: E402
from tablegen.link.prepare import PreparedScan  # noqa: E402
from tablegen.planning.line_plan import make_plan  # noqa: E402
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan  # noqa: E402
from tablegen.planning.turned_preview import turned_preview  # noqa: E402

EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
MOVES_NM = (20.0, -15.0, 30.0, 5.0, -25.0, 10.0, 20.0, -5.0, -20.0)
_BAUD, _WAY_S = 115200, 0.001


class _TimedLine(VirtualLine):
    """A line that sums up the processor time of the model behind it."""

    model_s = 0.0

    def read(self, timeout_s: float) -> bytes:
        """Read as the line does."""
        start = time.process_time()
        data = super().read(timeout_s)
        self.model_s += time.process_time() - start
        return data


def _row(name: str, host_s: list[float], line_s: list[float], sent: list[int]) -> str:
    host, line = statistics.median(host_s), statistics.median(line_s)
    return f"{name:<8} {host * 1e3:9.1f} {line * 1e3:9.1f} {(host + line) * 1e3:9.1f} {statistics.median(sent):9.0f}"


def at_angle(angle_deg: float) -> None:
    """Print what previews at an angle leave, their processor time beside that of a plan, and the times of moves."""
    changes: dict[str, tuple[float, tuple[str, ...]]] = {
        "a move by 5 V": (0.0, ("x.offset_v = 45.0",)),
        "a zoom by 0.8": (0.0, ("x.size_nm = 240", "y.size_nm = 240")),
        "a turn by 5 degrees": (5.0, ()),
        "a turn by 30 degrees": (30.0, ()),
    }
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        plan = make_turned_plan(turned_setup(Path(folder), angle_deg))
        print(f"a plan takes {time.process_time() - start:.1f} s of CPU time; image {_image_bytes(plan)} bytes")
        for name, (by_deg, edits) in changes.items():
            start = time.process_time()
            preview = turned_preview(turned_setup(Path(folder), angle_deg + by_deg, *edits), plan)
            seconds = time.process_time() - start
            errors = preview and f"{preview.x_error_percent:.2f} % of x, {preview.y_error_percent:.2f} % of y"
            print(f"{name:<22} {errors or 'no preview'}, {seconds:.2f} s")
        straight = PreparedScan.of_plan(make_plan(load(write_turned(Path(folder), 0.0))))
        info = info_for(straight)
        steps = {f"{axis}_limits": replace(getattr(info, f"{axis}_limits"), max_step=1 << 16) for axis in "xy"}
        more = More.SLOW_PARTS | More.MOVE | More.SLOW_MOVE
        slow = {"more": more, "slow_knots": 17, "slow_index_bits": 6, "degree": SPLINE_DEGREE}
        print(f"\n{len(MOVES_NM)} moves at {_BAUD} baud, {_WAY_S * 1e3:g} ms each way; medians")
        moved(write_turned(Path(folder), angle_deg), replace(info, **slow, **steps))  # type: ignore[arg-type]


def _image_bytes(plan: TurnedPlan) -> int:
    return len(PreparedScan.of_turned(plan).image("table").data)


def moved(path: Path, info: DeviceInfo) -> None:
    """Move a scan on a device with modes of a COMMIT, and print the medians."""
    info = replace(info, features=info.features | Feature.COMMIT_MODES)
    line = _TimedLine(model(info), baud=_BAUD, tick_hz=info.update_rate_hz, out_s=_WAY_S, back_s=_WAY_S)
    taken: list[tuple[float, float, int]] = []  # when the device said that a program plays
    with client(line) as device:
        exchange = device._session.exchange

        def now() -> tuple[float, float, int]:
            return time.process_time() - line.model_s, line.now(), exchange.bytes_sent

        def timed(play: Callable[..., object]) -> Callable[..., object]:
            def played(*arguments: object, **options: object) -> object:
                result = play(*arguments, **options)
                taken.append(now())
                return result

            return played

        for name in ("upload", "move"):
            setattr(device, name, timed(getattr(device, name)))
        live = Live(device, path)
        live.start()
        rows: dict[str, tuple[list[float], list[float], list[int]]] = {
            name: ([], [], []) for name in ("preview", "exact")
        }
        errors = []
        for by_nm in MOVES_NM:
            taken.clear()
            start = now()
            scan = live.move(by_nm, by_nm)
            assert scan.preview is not None
            preview, exact = taken
            errors.append(max(scan.preview.x_error_percent, scan.preview.y_error_percent))
            for name, at in (("preview", preview), ("exact", exact)):
                for values, before, after in zip(rows[name], start, at, strict=True):
                    values.append(after - before)  # type: ignore[arg-type]
    print("            CPU ms   line ms    all ms  bytes sent")
    for name, values in rows.items():
        print(_row(name, *values))
    print(f"a preview is within {max(errors):.2g} % of the size")


def main() -> int:
    """Move the example without and with its limits, or print the errors of previews at an angle."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--angle", type=float, metavar="DEGREES", help="print the errors of previews at an angle")
    if (angle_deg := parser.parse_args().angle) is not None:
        at_angle(angle_deg)
        return 0
    print(f"{len(MOVES_NM)} moves of {EXAMPLE.stem} at {_BAUD} baud, {_WAY_S * 1e3:g} ms each way; medians")
    with tempfile.TemporaryDirectory() as folder:
        for name in (EXAMPLE.name, "scanner.toml"):
            text = EXAMPLE.with_name(name).read_text("utf-8")
            Path(folder, name).write_text(re.sub(r"(?ms)^\[limits\].*?(?=^\[|\Z)", "", text), "utf-8")
        print("\nwithout [limits]: the preview does not wait for the certificate")
        path = Path(folder) / EXAMPLE.name
        info = replace(info_for(PreparedScan.of_plan(make_plan(load(path)))), more=More.MOVE)
        moved(path, info)
        print("\nwith [limits]")
        moved(EXAMPLE, info)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

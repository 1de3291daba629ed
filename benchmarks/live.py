"""The time from a key of ``tablegen live`` to the first line of the preview and of the exact scan, and their bytes.

``python benchmarks/live.py`` moves the shipped example on a virtual line of 115200 baud: the client and the plans are
the real ones, and the device is the model. The time of the host is the processor time of this computer, without that of
the model; the time of the line is virtual, and has the wait for the start of a line.
"""

import statistics
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests" / "helpers"))  # the line and the device are those of the tests

from client_line import VirtualLine  # noqa: E402
from client_rig import client, info_for, model  # noqa: E402
from replacing import replace  # noqa: E402

from tablegen.api.live import Live  # noqa: E402
from tablegen.api.live_preview import LivePreview  # noqa: E402
from tablegen.config.load import load  # noqa: E402
from tablegen.link.messages import Feature, More  # noqa: E402
from tablegen.link.prepare import PreparedScan  # noqa: E402
from tablegen.planning.line_plan import make_plan  # noqa: E402

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


def main() -> int:
    """Move the example, and print the medians."""
    info = info_for(PreparedScan.of_plan(make_plan(load(EXAMPLE))))
    info = replace(info, features=info.features | Feature.COMMIT_MODES, more=More.MOVE)
    line = _TimedLine(model(info), baud=_BAUD, tick_hz=info.update_rate_hz, out_s=_WAY_S, back_s=_WAY_S)
    previews: list[tuple[float, float, int]] = []
    with client(line) as device:
        exchange = device._session.exchange

        def now() -> tuple[float, float, int]:
            return time.process_time() - line.model_s, line.now(), exchange.bytes_sent

        def note(_: LivePreview) -> None:
            previews.append(now())

        live = Live(device, EXAMPLE, on_preview=note)
        live.start()
        rows: dict[str, tuple[list[float], list[float], list[int]]] = {
            name: ([], [], []) for name in ("preview", "exact")
        }
        errors = []
        for by_nm in MOVES_NM:
            start = now()
            scan = live.move(by_nm, by_nm)
            end = now()
            assert scan.preview is not None
            errors.append(max(scan.preview.x_error_percent, scan.preview.y_error_percent))
            for name, at in (("preview", previews[-1]), ("exact", end)):
                for values, before, after in zip(rows[name], start, at, strict=True):
                    values.append(after - before)  # type: ignore[arg-type]
    print(f"{len(MOVES_NM)} moves of {EXAMPLE.stem} at {_BAUD} baud, {_WAY_S * 1e3:g} ms each way; medians")
    print("            CPU ms   line ms    all ms  bytes sent")
    for name, values in rows.items():
        print(_row(name, *values))
    print(f"a preview is within {max(errors):.2g} % of the size")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

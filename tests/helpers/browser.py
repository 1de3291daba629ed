"""A page in headless Chromium: its document after scripts have run, its console, its requests, and a picture of it."""

import json
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from building import tool
from limits import PATIENCE_S
from PIL import Image

_OPTIONS = (
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--hide-scrollbars",
)
_OWN = "not an origin"  # who asks, where it is Chromium itself and no page


@dataclass(frozen=True)
class Seen:
    """``console`` has a line a message; ``requests`` the addresses that the page asked for."""

    document: str
    console: list[str]
    requests: list[str]


def loaded(folder: Path, address: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run Chromium on an address; it has no network."""
    quiet = "--host-resolver-rules=MAP * ~NOTFOUND"
    command = [
        tool("chromium"),
        *_OPTIONS,
        quiet,
        f"--user-data-dir={folder / 'profile'}",
        "--virtual-time-budget=2000",
    ]
    done = subprocess.run(
        [*command, *options, address], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done


def seen(page: Path, folder: Path) -> Seen:
    """Load a page; ``folder`` is for the browser's own files."""
    log = folder / "net.json"
    done = loaded(folder, page.as_uri(), "--enable-logging=stderr", f"--log-net-log={log}", "--dump-dom")
    events = (event.get("params") for event in json.loads(log.read_text("utf-8"))["events"])
    asked = [one for one in events if isinstance(one, dict) and one.get("initiator", _OWN) != _OWN]
    requests = sorted({one["url"] for one in asked})
    return Seen(done.stdout, re.findall(r":CONSOLE[:(]\d*\)?\]? ?(.*)", done.stderr), requests)


def picture(page: Path, folder: Path, *options: str, width: int = 1200, height: int = 1600) -> np.ndarray:
    """The upper left of a page as rows x columns x red, green, blue."""
    target = folder / "picture.png"
    loaded(folder, page.as_uri(), f"--window-size={width},{height}", f"--screenshot={target}", *options)
    with Image.open(target) as image:
        return np.asarray(image.convert("RGB")).astype(int)

"""A page in headless Chromium: its document after scripts have run, its console, its requests, and a picture of it."""

import json
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

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
    "--no-first-run",
    "--hide-scrollbars",
)
# What Chromium asks for itself, and does not get: by whole names, so that fonts.googleapis.com is a page's.
_OWN = {f"{name}.google.com" for name in ("accounts", "clients2", "android.clients", "www", "mtalk")}
_OWN |= {f"{name}.googleapis.com" for name in ("update", "content-autofill", "safebrowsing", "optimizationguide-pa")}
_OWN |= {"redirector.gvt1.com", "edgedl.me.gvt1.com"}


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
    asked = {
        event["params"]["url"]
        for event in json.loads(log.read_text("utf-8"))["events"]
        if isinstance(event.get("params"), dict) and "url" in event["params"]
    }
    hosts = {address: str(urlsplit(address).hostname) for address in asked}
    requests = sorted(address for address, host in hosts.items() if host not in _OWN)
    return Seen(done.stdout, re.findall(r":CONSOLE[:(]\d*\)?\]? ?(.*)", done.stderr), requests)


def picture(page: Path, folder: Path, *options: str, width: int = 1200, height: int = 1600) -> np.ndarray:
    """The upper left of a page as rows x columns x red, green, blue."""
    target = folder / "picture.png"
    loaded(folder, page.as_uri(), f"--window-size={width},{height}", f"--screenshot={target}", *options)
    with Image.open(target) as image:
        return np.asarray(image.convert("RGB")).astype(int)

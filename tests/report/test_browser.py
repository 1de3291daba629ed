"""The page in a browser: no error, no request; painted without scripts, in both colour schemes; values and zoom."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import loaded, picture, seen
from editing import run, write_pair

pytestmark = pytest.mark.common

LIGHT = {"forward": (0x00, 0x72, 0xB2), "backward": (0xC4, 0x4E, 0x00)}
DARK = {"forward": (0x56, 0xB4, 0xE9), "backward": (0xF0, 0xA0, 0x30)}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    assert run("report", write_pair(folder), "-o", folder / "report.html").status == 0
    return folder / "report.html"


def changed(page: Path, *edits: tuple[str, str]) -> Path:
    """A copy of the page without its policy, and with edits."""
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text("utf-8"))
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    copy = page.with_name("changed.html")
    copy.write_text(text, "utf-8")
    return copy


def test_no_error_and_no_request(page: Path, tmp_path: Path) -> None:
    found = seen(page, tmp_path)
    assert found.console == []
    assert found.requests == []
    assert "<output" in found.document  # the script has run, so the policy lets it


def test_errors_and_requests_are_found(page: Path, tmp_path: Path) -> None:
    """Negative controls: a script that asks and fails, and one that the policy does not know."""
    text = "<script>fetch('http://127.0.0.1:9/a').catch(() => {}); wrong();</script></body>"
    found = seen(changed(page, ("</body>", text)), tmp_path)
    assert any("wrong is not defined" in line for line in found.console)
    assert found.requests == ["http://127.0.0.1:9/a"]
    strange = page.with_name("strange.html")
    strange.write_text(page.read_text("utf-8").replace("</body>", text), "utf-8")
    found = seen(strange, tmp_path)
    assert any("Content Security Policy" in line for line in found.console)
    assert found.requests == []


def near(image: np.ndarray, colour: tuple[int, int, int]) -> int:
    """How many pixels have about a colour."""
    return int(np.sum(np.max(np.abs(image - np.array(colour)), axis=2) < 12))


@pytest.mark.parametrize(("scheme", "colours"), [(1, LIGHT), (0, DARK)])
def test_it_is_painted_without_scripts(
    page: Path, tmp_path: Path, scheme: int, colours: dict[str, tuple[int, int, int]]
) -> None:
    """In the light and the dark scheme: curves of both directions, in colours of the scheme alone."""
    only = changed(page, ("<main>", "<style>section:not(#lines){display:none}</style><main>"))
    text = re.sub(r"<script>.*?</script>", "", only.read_text("utf-8"), flags=re.DOTALL)
    only.write_text(text, "utf-8")
    image = picture(only, tmp_path, f"--blink-settings=preferredColorScheme={scheme}")
    assert near(image, colours["forward"]) > 800
    assert near(image, colours["backward"]) > 400
    other = DARK if colours is LIGHT else LIGHT
    assert near(image, other["forward"]) < 50
    background = np.median(image[:, -4:].reshape(-1, 3), axis=0)
    assert (background.mean() > 200) == (scheme == 1)


def test_a_narrow_page_does_not_scroll_sideways(page: Path, tmp_path: Path) -> None:
    """At 400 px, which is narrower than a window of the browser may be: in a frame."""
    script = (
        "<script>document.title = JSON.stringify([innerWidth, document.documentElement.scrollWidth])</script></body>"
    )
    changed(page, ("</body>", script))
    frame = page.with_name("frame.html")
    frame.write_text(
        '<iframe id="f" src="changed.html" style="width:400px;height:900px"></iframe><script>onload = () => '
        "{ document.title = document.getElementById('f').contentDocument.title }</script>",
        "utf-8",
    )
    done = loaded(tmp_path, frame.as_uri(), "--allow-file-access-from-files", "--dump-dom")
    title = re.search(r"<title>(.*?)</title>", done.stdout)
    assert title
    inner, scrolled = json.loads(title[1])
    assert 380 <= inner <= 400
    assert scrolled <= inner


ACTIONS = """<script>(() => {
  const chart = document.querySelector("#chart-drive-x svg.chart"), box = () => chart.getBoundingClientRect();
  chart.scrollIntoView(); chart.setPointerCapture = () => {};
  const at = (kind, x, y) => chart.dispatchEvent(new PointerEvent(kind, {bubbles: true, pointerId: 1, button: 0,
    clientX: box().left + x * box().width, clientY: box().top + y * box().height}));
  const output = chart.parentElement.querySelector("output"), reset = chart.parentElement.querySelector("button");
  const inner = chart.querySelector(".inner");
  const labels = () => [...chart.querySelectorAll(".ticks text")].map((t) => t.textContent);
  const told = {whole: inner.getAttribute("viewBox"), labels: labels()};
  at("pointermove", 0.5, 0.5); told.value = output.textContent;
  at("pointerdown", 0.3, 0.3); at("pointermove", 0.5, 0.6); at("pointerup", 0.5, 0.6);
  told.zoomed = inner.getAttribute("viewBox"); told.finer = labels(); told.button = !reset.hidden;
  chart.dispatchEvent(new KeyboardEvent("keydown", {key: "Escape"}));
  told.back = inner.getAttribute("viewBox"); told.again = labels(); told.gone = reset.hidden;
  chart.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowRight"})); told.stepped = output.textContent;
  document.title = JSON.stringify(told);
})()</script></body>"""


def test_values_under_the_pointer_and_zoom(page: Path, tmp_path: Path) -> None:
    import tablegen

    found = seen(changed(page, ("</body>", ACTIONS)), tmp_path)
    assert found.console == []
    title = re.search(r"<title>(.*?)</title>", found.document)
    assert title
    told = json.loads(title[1].replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&"))
    number = r"(-?[\d.]+)"
    value = re.fullmatch(rf"time \[ms\]: {number} .*: forward {number}, plain triangle {number}", told["value"])
    assert value, told["value"]
    samples = tablegen.build(page.with_name("scan.toml")).x
    played = np.interp(float(value[1]), 1e3 * samples.time_s, samples.volts)
    assert float(value[2]) == pytest.approx(played, abs=0.1)
    whole, zoomed = (list(map(float, told[name].split())) for name in ("whole", "zoomed"))
    assert told["button"]
    assert zoomed[2] < 0.5 * whole[2]
    assert zoomed[3] < 0.6 * whole[3]
    assert told["finer"] != told["labels"]
    assert (told["back"], told["again"], told["gone"]) == (told["whole"], told["labels"], True)
    assert told["stepped"].startswith("time [ms]: ")


POINTING = """<script>addEventListener("load", () => setTimeout(() => {
  const own = [...document.querySelectorAll("svg.picture")].at(-1), told = [];
  own.scrollIntoView();
  for (const share of [0.25, 0.75]) {
    const box = own.getBoundingClientRect();
    const at = {clientX: box.left + share * box.width, clientY: box.top + 0.5 * box.width};
    own.dispatchEvent(new PointerEvent("pointermove", at));
    told.push(own.nextElementSibling.textContent);
  }
  document.title = JSON.stringify(told);
}, 300))</script></body>"""


def test_values_of_an_own_image_under_the_pointer(page: Path, tmp_path: Path) -> None:
    """A step of 2 in the middle: -1 at the left and +1 at the right, levelled; places in nm of the scan file."""
    np.save(tmp_path / "step.npy", np.where(np.arange(64) < 32, 3.0, 5.0) * np.ones((64, 1)))
    own = tmp_path / "own.html"
    outcome = run("report", page.with_name("scan.toml"), "-o", own, "--image", tmp_path / "step.npy")
    assert outcome.status == 0, outcome.err
    found = seen(changed(own, ("</body>", POINTING)), tmp_path)
    assert found.console == []
    title = re.search(r"<title>(.*?)</title>", found.document)
    assert title
    left, right = json.loads(title[1])
    assert re.fullmatch(r"x 40 nm, y [\d.]+ nm, height -1.00 units of the file", left), left
    assert re.fullmatch(r"x 120 nm, y [\d.]+ nm, height 1.00 units of the file", right), right

"""A page as an HTML parser finds it, and what every page of ours has to be."""

import base64
import hashlib
import re
from html.parser import HTMLParser

VOID = {"meta", "link", "br", "img", "hr", "input"}
MOST_BYTES = 1_500_000


class Page(HTMLParser):
    """What a page has, by a parser that believes nothing: elements that do not close are faults."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.handlers: list[str] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        self.tags: set[str] = set()
        self.verdicts: list[str] = []
        self.policy = ""
        self.feed(text)
        self.close()
        self.faults += [f"<{tag}> stays open" for tag in self.open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self._look(tag, dict(attrs))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self._look(tag, dict(attrs))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data: str) -> None:
        inside = self.open[-1] if self.open else ""
        if inside != "style":
            (self.scripts if inside == "script" else self.texts).append(data)

    def _look(self, tag: str, attributes: dict[str, str | None]) -> None:
        if "id" in attributes:
            self.ids.append(str(attributes["id"]))
        self.addresses += [str(attributes[name]) for name in ("href", "src", "action", "data") if name in attributes]
        self.handlers += [name for name in attributes if name.startswith("on") or name == "style"]
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy":
            self.policy = str(attributes["content"])
        if tag == "p" and str(attributes.get("class", "")).startswith("verdict"):
            self.verdicts.append(str(attributes["class"]).split()[1])

    @property
    def said(self) -> str:
        return " ".join(" ".join(self.texts).split())


def well_formed(content: bytes, read: Page) -> None:
    assert read.faults == []
    assert len(read.ids) == len(set(read.ids))
    inside = [address for address in read.addresses if address.startswith("#")]
    assert {address[1:] for address in inside} <= set(read.ids)
    assert [a[:40] for a in read.addresses if a not in inside and not a.startswith("data:")] == []
    text = content.decode("utf-8")
    assert set(re.findall(r"[a-z]+://[^\s\"'<]+", text)) <= {"http://www.w3.org/2000/svg"}  # a name, no address
    assert not re.search(r"@import|url\(", text)
    assert read.handlers == []
    assert len(read.scripts) == 1
    digest = base64.b64encode(hashlib.sha256(read.scripts[0].encode()).digest()).decode()
    assert read.policy.startswith("default-src 'none';")
    assert f"script-src 'sha256-{digest}'" in read.policy
    assert len(content) < MOST_BYTES

"""Share of a serial line that is payload, of the real client and by the framing of other protocols."""

from link import example, rate

from sections.framing import PROTOCOLS, Way
from sections.processes import python_version
from sections.section import Section

TITLE = "Payload of a serial line"
TEXT = """The tables of the example, uploaded to a device that has another scan: payload over what the line could have
carried in the time. Ours is the real client on a line in virtual time, from BEGIN until the scan is active, which
waits for the end of a line of the scan (up to 2.5 ms); with a window of 8 frames, and of 1: stop and wait. The others
are computed from their framing (`benchmarks/sections/framing.py` names the sources), on a line without faults,
devices that answer at once, and no time to start what was sent."""
HEAD = ("protocol", "checks by", "115200 baud, 1 ms each way", "460800 baud, 1 ms out and 16 ms back")
WAYS = (Way(115200, 0.001, 0.001), Way(460800, 0.001, 0.016))


def measure() -> Section:
    """In virtual time: the same on every machine."""
    scan, other = example()
    image = other.image("table")
    rows = []
    for what, window in (("ours, 8 frames at a time", 8), ("ours, stop and wait", 1)):
        rates = [rate(scan, image, way.baud, way.back_s, window) for way in WAYS]
        rows.append([what, "CRC-32", *(f"{100 * one.payload:.1f} %" for one in rates)])
    size, sent = len(image.data), rates[0].wire_bytes
    for what, (checks, framing) in PROTOCOLS.items():
        shares = [way.share(size, framing(size)) for way in WAYS]
        rows.append([what, checks, *(f"{100 * share:.1f} %" for share in shares)])
    return Section(
        TITLE,
        TEXT.replace("The tables", f"The {size} bytes of tables"),
        HEAD,
        rows,
        notes(rows, sent / size),
        python_version(),
    )


def notes(rows: list[list[str]], sent: float) -> list[str]:
    """Who carries most; ``sent`` is what we send over the payload."""
    found = []
    for column in (2, 3):
        best = max(rows, key=lambda row: float(row[column].split()[0]))
        found.append(f"{HEAD[column]}: most by {best[0]}")
    return [
        f"{'; '.join(found)}.",
        f"What we send is {sent:.3f} of the payload: frames of 254 bytes at most, each with its place, its number "
        "and a CRC-32, so that a small device needs no more memory. Blocks of 1024 bytes take less framing, but a "
        "wait each.",
    ]

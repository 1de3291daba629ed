"""Files of instruments, each by its format's published description; what of a header no reader needs is zero.

Heights are rows x columns, row 0 first in time and the left end of the line at the left, as tablegen has them; a
writer stores them as the instrument does.
"""

import io
import json
import struct
import zlib
from base64 import b85decode
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.io import netcdf_file

from tablegen.numerics.arrays import Floats

Both = Mapping[str, tuple[Floats, Floats]]  # trace and retrace by signal


def sxm(
    signals: Both,
    nm: tuple[float, float] = (500.0, 250.0),
    scan_dir: str = "up",
    units: str = "m",
    angle_deg: float = 0.0,
    times_s: tuple[float, float] = (0.4, 0.1),
) -> bytes:
    """Nanonis: big-endian floats in the order of time, so that backward lines begin at the right."""
    rows, columns = next(iter(signals.values()))[0].shape
    info = "".join(f"\t{14 + n}\t{name}\t{units}\tboth\t9.0E-9\t0.0E+0\n" for n, name in enumerate(signals))
    header = (
        ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\n              FLOAT            MSBFIRST\n:REC_DATE:\n 22.11.2026\n"
        ":REC_TIME:\n12:34:56\n:REC_TEMP:\n      290.0000000000\n:ACQ_TIME:\n       128.2\n"
        f":SCAN_PIXELS:\n       {columns}       {rows}\n:SCAN_FILE:\nC:\\scan.sxm\n"
        f":SCAN_TIME:\n             {times_s[0]:.3E}             {times_s[1]:.3E}\n"
        f":SCAN_RANGE:\n           {nm[0] * 1e-9:.6E}           {nm[1] * 1e-9:.6E}\n"
        f":SCAN_OFFSET:\n             0.000000E+0         0.000000E+0\n:SCAN_ANGLE:\n            {angle_deg:.3E}\n"
        f":SCAN_DIR:\n{scan_dir}\n:BIAS:\n            1.000E+0\n:COMMENT:\nof a test\n"
        f":DATA_INFO:\n\tChannel\tName\tUnit\tDirection\tCalibration\tOffset\n{info}\n:SCANIT_END:\n\n\n"
    )
    blocks = b"".join(t.astype(">f4").tobytes() + r[:, ::-1].astype(">f4").tobytes() for t, r in signals.values())
    return header.encode("latin-1") + b"\x1a\x04" + blocks


def ibw(
    channels: Mapping[str, Floats],
    note: Mapping[str, str],
    order: str = "<",
    turned: bool = False,
    step_m: tuple[float, float] = (0.0, 0.0),
) -> bytes:
    """Igor, version 5: values with x first; ``turned`` stores the row that is first in time last.

    ``step_m`` is the scaling of columns and rows.
    """
    rows, columns = next(iter(channels.values())).shape
    stored = [heights[::-1] if turned else heights for heights in channels.values()]
    values = b"".join(heights.astype(f"{order}f4").tobytes() for heights in stored)
    text = "".join(f"{key}: {value}\r" for key, value in {"ImageNote": "", **note}.items()).encode()
    labels = b"".join(label.encode().ljust(32, b"\0") for label in ("", *channels))
    sizes = struct.pack(f"{order}15i", 320 + len(values), 0, len(text), *[0] * 5, 0, 0, len(labels), *[0] * 4)
    wave = bytearray(320)
    struct.pack_into(f"{order}ih", wave, 12, rows * columns * len(stored), 2)
    wave[28:33] = b"Image"
    struct.pack_into(f"{order}4i", wave, 68, columns, rows, len(stored), 0)
    struct.pack_into(f"{order}2d", wave, 84, *step_m)
    wave[148:149] = b"m"
    head = struct.pack(f"{order}hh", 5, 0) + sizes + wave
    checksum = -int(np.frombuffer(head, f"{order}i2").sum()) & 0xFFFF
    return head[:2] + struct.pack(f"{order}H", checksum) + head[4:] + values + text + labels


def spm(
    signals: Both,
    nm: tuple[float, float] = (500.0, 500.0),
    frame: str = "Up",
    stored: int = 2,
    aspect: str = "1:1",
    of_scan: str = "",
    of_image: str = "",
) -> bytes:
    """Nanoscope: the bottom row first, integers of 100 nm full scale; further lines of the scan and of each image."""
    start, lists, blocks = 1 << 12, "", b""
    for signal, both in signals.items():
        for name, heights in zip(("Trace", "Retrace"), both, strict=True):
            rows, columns = heights.shape
            steps = np.round((heights[::-1] if frame == "Down" else heights) / 100.0 * 256.0**stored)
            block = steps.astype(f"<i{stored}").tobytes()
            lists += (
                f"\\*Ciao image list\r\n\\Data offset: {start + len(blocks)}\r\n\\Data length: {len(block)}\r\n"
                f"\\Bytes/pixel: 2\r\n\\Start context: OL\r\n\\Samps/line: {columns}\r\n\\Number of lines: {rows}\r\n"
                f"\\Aspect Ratio: {aspect}\r\n\\Scan Size: {nm[0]:g} {nm[1]:g} nm\r\n\\Line Direction: {name}\r\n"
                f"\\Frame direction: {frame}\r\n{of_image}"
                f'\\@2:Image Data: S [{signal.replace(" ", "")}] "{signal}"\r\n'
                f"\\@2:Z scale: V [Sens. Zsens] (0.000305 V/LSB) 20.00000 V\r\n"
                f"\\@2:Z offset: V [Sens. Zsens] (0.000305 V/LSB) 0 V\r\n"
            )
            blocks += block
    header = (
        "\\*File list\r\n\\Version: 0x09400202\r\n\\Date: 10:00:00 AM Sun Nov 22 2026\r\n"
        "\\*Equipment list\r\n\\Description: MultiMode\r\n\\*Scanner list\r\n\\@Sens. Zsens: V 5.000000 nm/V\r\n"
        f"\\*Ciao scan list\r\n\\Scan Size: {nm[0]:g} nm\r\n\\Scan Rate: 2.5\r\n{of_scan}{lists}"
        "\\*File list end\r\n\x1a"
    )
    return header.encode("cp1252").ljust(start, b"\0") + blocks


def jpk(
    signals: Both,
    nm: tuple[float, float] = (500.0, 250.0),
    big: bool = False,
    angle_deg: float = 0.0,
    preview: tuple[str, tuple[int, ...]] = ("settings", (8, 8, 3)),
    lines: int | None = None,
) -> bytes:
    """JPK: a page with a picture and the grid, then pages of 16 bits, 0.01 nm a step from -100 nm.

    ``preview`` is the name and the shape of the picture, ``lines`` those of the grid if the scan was stopped.
    """
    order = ">" if big else "<"
    rows, columns = next(iter(signals.values()))[0].shape
    grid = {0x8042: nm[0] * 1e-9, 0x8043: nm[1] * 1e-9, 0x8044: float(np.radians(angle_deg))}
    grid |= {0x8045: 0, 0x8046: columns, 0x8047: lines or rows, 0x8049: 4.0, 0x8050: preview[0]}
    pages = [({**grid, 262: 2 if len(preview[1]) > 2 else 1}, np.zeros(preview[1], np.uint8))]
    for signal, both in signals.items():
        for flag, heights in enumerate(both):
            steps = np.round((heights + 100.0) / 0.01).astype(f"{order}u2")
            slots = {0x8080: 2, 0x8081: "nominal", **_slot(0, "volts", "LinearScaling", "V", 1.0, 2.0)}
            slots |= _slot(1, "nominal", "LinearScaling", "m", 0.01e-9, -100e-9)
            pages.append(({0x8050: signal, 0x8051: flag, 262: 1, **slots}, steps))
    out = bytearray(b"MM\0*" if big else b"II*\0") + bytes(4)
    at = 4  # where the place of the next directory stands
    for tags, matrix in pages:
        struct.pack_into(f"{order}I", out, at, len(out))
        at = _page(out, order, tags, matrix)
    return bytes(out)


def _slot(slot: int, name: str, scaling: str, unit: str, factor: float, offset: float) -> dict[int, int | float | str]:
    first = 0x8090 + 0x30 * slot
    return {first: name, first + 0x12: unit, first + 0x13: scaling, first + 0x14: factor, first + 0x15: offset}


def _page(out: bytearray, order: str, tags: Mapping[int, int | float | str], matrix: np.ndarray) -> int:
    """Append a directory, what its tags point at, and its pixels; where the next directory is to be named."""
    rows, columns, *colours = matrix.shape
    pixels = matrix.tobytes()
    own: dict[int, int | float | str] = {256: columns, 257: rows, 258: 8 * matrix.itemsize, 259: 1}
    own |= {277: colours[0] if colours else 1, 278: rows, 279: len(pixels), **tags}
    first = len(out) + 2
    beyond = first + 12 * (len(own) + 1) + 4
    entries, far = b"", b""
    for code, value in sorted({**own, 273: 0}.items()):
        if code == 273:
            entries += struct.pack(f"{order}HHII", code, 4, 1, 0)
        elif isinstance(value, int):
            entries += struct.pack(f"{order}HHII", code, 4, 1, value)
        else:
            text = value.encode() + b"\0" if isinstance(value, str) else struct.pack(f"{order}d", value)
            kind, count = (2, len(text)) if isinstance(value, str) else (12, 1)
            near = text.ljust(4, b"\0") if len(text) <= 4 else struct.pack(f"{order}I", beyond + len(far))
            entries += struct.pack(f"{order}HHI", code, kind, count) + near
            far += text if len(text) > 4 else b""
    place = sorted({**own, 273: 0}).index(273) * 12 + 8
    entries = entries[:place] + struct.pack(f"{order}I", beyond + len(far)) + entries[place + 4 :]
    out += struct.pack(f"{order}H", len(own) + 1) + entries + bytes(4) + far + pixels
    return first + len(entries)


def asd(
    channels: Mapping[str, Floats], version: int = 1, nm: tuple[int, int] = (400, 200), code: int = 0x40000
) -> bytes:
    """High-speed AFM: frames x rows x columns of nm by signal, TP or ER; 12 bits over -5..5 V, 0.05 nm a level."""
    frames, rows, columns = next(iter(channels.values())).shape
    extension, gain, sensor = 10.24, 2.0, 20.48  # nm/V, 1, nm/V: 20.48 nm/V x 10 V / 4096
    bipolar_5_v = 0x40000
    body = b""
    for name, movie in channels.items():
        sign = 1.0 if name == "TP" else -1.0
        levels = np.round((5.0 * 20.48 - sign * movie) / 0.05).astype("<i2")
        for number, frame in enumerate(levels):
            body += struct.pack("<i4h2f1x1b1h2i", number, 0, 0, 0, 0, 0.0, 0.0, 0, 0, 0, 0) + frame.tobytes()
    names = [*channels, ""][:2]
    user, comment = b"user", b"comment"
    if version == 0:
        head = struct.pack(
            "<5i4h3fIi", 0, 0, len(user), 0, len(comment), columns, rows, *nm, 500.0, extension, gain, code, 12
        )
        head += bytes(1 + 4 + 2 + 2 + 6 + 8 + 12 + 4) + struct.pack("<iih", frames, 7, 1) + user
        head += struct.pack("<2fi", sensor, 1.0, 0) + comment
        head = "".join(name.ljust(2, "\0") for name in names).encode() + head
        at = 4
    else:
        head = struct.pack("<5i", 0, 0, 65001, len(user), len(comment))
        head += b"".join(name.encode("utf-16-le").ljust(4, b"\0") for name in names)
        head += struct.pack("<8i", frames, frames, 0, 1, columns, rows, *nm) + bytes(1 + 4 + 24 + 8)
        head += struct.pack("<3fi", 500.0, sensor, 1.0, 0) + bytes(12) + struct.pack("<iIi", 7, bipolar_5_v, 12)
        head += struct.pack("<6f", 5000.0, 5000.0, 1.0, 1.0, extension, gain) + user + comment
        if version == 2:
            head += struct.pack("<iid5i", frames, 0, 0.0, 0, 0, 0, 0, 0)
        at = 0
    head = head[:at] + struct.pack("<2i", 4 + len(head), 32) + head[at + 8 :]
    return struct.pack("<i", version) + head + body


def iso28600(
    channels: Mapping[str, Floats],
    nm: tuple[float, float] = (500.0, 250.0),
    mode: str = "MAP_SC",
    slow: str = "top to bottom",
    fast: str = "X",
    angle_deg: float = 0.0,
) -> bytes:
    """ISO 28600: 128 lines, then the values of all channels of a pixel in a line."""
    rows, columns = next(iter(channels.values())).shape
    names = [line for title in channels for line in (title, "m", "")]
    single = names[:3] if mode == "MAP_SC" else ["", "n", ""]
    head = ["ISO/TC 201 SPM data transfer format", "general information", "", "", "", "", "of a test", mode]
    head += ["-1"] * 7 + ["scan information", "REGULAR MAPPING", "open-loop scanner", "sample XYZ scan"]
    head += [fast, "left to right", "Y", slow, f"{columns}", f"{rows}", "m", "um", f"{nm[0] * 1e-9:g}"]
    head += [f"{nm[1] * 1e-3:g}", "m", "m", "0", "0", f"{angle_deg:g}", "m/s", "0.0", "Hz", "2.5", "", "sample biased"]
    head += ["0.0", "0", "", "", "", "", "", "environment description", "software", "300", "1.0e5", "40", ""]
    head += ["probe description", "", "", "0.0", "0.0", "0.0", "0", "0", "0", "", "sample description", "", "", ""]
    head += ["single-channel mapping description", *single, "spectroscopy description", "", "REGULAR", "", "n"]
    head += ["0.0"] * 4 + ["0", "0", "", "n", "0.0", "", "data treatment description", "raw data", "", "", "", ""]
    head += ["multi-channel mapping description", f"{len(channels)}", *names]
    head += [""] * (127 - len(head)) + ["end of header"]
    values = np.stack([heights.ravel() for heights in channels.values()], axis=1)
    body = [", ".join(f"{value:.9g}" for value in pixel) for pixel in values]
    return "\n".join([*head, *body, "end of experiment", ""]).encode()


def wsxm(
    heights: Floats,
    kind: str = "short",
    direction: str = "Forward",
    slow: str = "Up",
    nm: tuple[float, float] = (500.0, 250.0),
    angle_deg: float = 0.0,
) -> bytes:
    """WSxM: the last pixel of the picture first; 16 bits over the amplitude, or nm as they are."""
    rows, columns = heights.shape
    picture = (heights[::-1] if slow == "Up" else heights).ravel()[::-1]
    span = float(np.ptp(picture))
    levels = np.round((picture - picture.min()) / (span or 1.0) * 65535.0 - 32768.0)
    body = levels.astype("<i2").tobytes() if kind == "short" else picture.astype("<f8").tobytes()
    text = (
        "WSxM file copyright Nanotec Electronica\r\nSxM Image file\r\nImage header size: {:5d}\r\n\r\n[Control]\r\n\r\n"
        f"    Rotation: {angle_deg:g} Deg\r\n    X Amplitude: {nm[0]:g} nm\r\n    X-Frequency: 2.5 Hz\r\n"
        f"    Y Amplitude: {nm[1] * 1e-3:g} um\r\n\r\n[General Info]\r\n\r\n    Acquisition channel: Topography\r\n"
        f"    Image Data Type: {kind}\r\n    Number of columns: {columns}\r\n    Number of rows: {rows}\r\n"
        f"    X scanning direction: {direction}\r\n    Y scanning direction: {slow}\r\n"
        f"    Z Amplitude: {span:.9g} nm\r\n\r\n[Header end]\r\n"
    )
    return text.format(len(text.format(0))).encode("latin-1") + body


def createc(channels: Sequence[Floats], kind: str = "Paramco32", nm: tuple[float, float] = (500.0, 250.0)) -> bytes:
    """Createc: a header of 16 KiB, one number without use, then all channels; packed in the last version."""
    rows, columns = channels[0].shape
    header = (
        f"[{kind}]\r\nTitel / Titel=\r\nNum.X / Num.X={columns}\r\nNum.Y / Num.Y={rows}\r\nDelta X / Delta X=4\r\n"
        f"Rotation / Rotation=90\r\nChannels / Channels={len(channels)}\r\nDacto[A]z=0.005\r\n"
        f"Length x[A]={nm[0] * 10.0:g}\r\nLength y[A]={nm[1] * 10.0:g}\r\nSec/Image:=12\r\n"
    )
    numbers = np.concatenate([[0.0], *[heights.ravel() for heights in channels], np.zeros(4 * columns)])
    body = np.round(numbers * 1000.0).astype("<i2" if kind == "Parameter" else "<f4").tobytes()
    return header.encode().ljust(1 << 14, b"\0") + (zlib.compress(body) if kind == "Paramco32" else body)


def nid(signals: Both, nm: tuple[float, float] = (500.0, 250.0), bits: int = 32, curves: bool = False) -> bytes:
    """Nanosurf: a group for each direction, the range of 200 nm about 0 over all levels; and curves before them."""
    rows, columns = next(iter(signals.values()))[0].shape
    text = f"[DataSet]\r\nVersion=2\r\nGroupCount={2 + curves}\r\n"
    sets, body = "", b""
    if curves:
        text += "Gr0-Count=1\r\nGr0-Ch0=DataSet-9:0\r\n"
        sets += (
            "[DataSet-9:0]\r\nPoints=3\r\nLines=2\r\nFrame=Spec forward\r\nDim1Name=SpecPoint\r\nDim1Unit=\r\n"
            "SaveMode=Binary\r\nSaveBits=16\r\nSaveSign=Signed\r\nSaveOrder=Intel\r\n"
        )
        body += bytes(12)
    for way, frame in enumerate(("Scan forward", "Scan backward")):
        group = way + curves
        text += f"Gr{group}-Count={len(signals)}\r\n"
        for at, (signal, both) in enumerate(signals.items()):
            text += f"Gr{group}-Ch{at}=DataSet-{group}:{at}\r\n"
            sets += (
                f"[DataSet-{group}:{at}]\r\nVersion=2\r\nPoints={columns}\r\nLines={rows}\r\nFrame={frame}\r\n"
                f"Dim0Name=X*\r\nDim0Unit=m\r\nDim0Range={nm[0] * 1e-9:g}\r\nDim0Min=0\r\n"
                f"Dim1Name=Y*\r\nDim1Unit=m\r\nDim1Range={nm[1] * 1e-9:g}\r\nDim1Min=0\r\n"
                f"Dim2Name={signal}\r\nDim2Unit=m\r\nDim2Range=2e-07\r\nDim2Min=-1e-07\r\n"
                f"SaveMode=Binary\r\nSaveBits={bits}\r\nSaveSign=Signed\r\nSaveOrder=Intel\r\n\r\n"
            )
            body += np.round(both[way] / 200.0 * 2.0**bits).astype(f"<i{bits // 8}").tobytes()
    text += "[DataSet-Info]\r\nRotation=90\u00b0\r\n"
    return (text + sets).encode("latin-1") + b"#!" + body


def gxsm(
    heights: Floats,
    back: bool = False,
    nm: tuple[float, float] = (500.0, 250.0),
    angle_deg: float = 0.0,
    frames: int = 1,
) -> bytes:
    """GXSM as scipy writes NetCDF: integers of 0.01 Ångström, a backward line from its right end."""
    file = io.BytesIO()
    with netcdf_file(file, "w") as out:
        for name, length in {"time": frames, "value": 1, "dimy": heights.shape[0], "dimx": heights.shape[1]}.items():
            out.createDimension(name, length)
        out.createDimension("text", 40)
        field = out.createVariable("FloatField", "f", ("time", "value", "dimy", "dimx"))
        stored = np.round(heights[:, ::-1] if back else heights, 3) * 1000.0
        field[:] = np.stack([stored + 10.0 * frame for frame in range(frames)])[:, None]
        field.long_name = "Topography"
        out.createVariable("basename", "c", ("text",))[:] = f"/data/scan001-{'Xm' if back else 'Xp'}-Topo.nc".ljust(
            40, "\0"
        )
        values = {"rangex": 10.0 * nm[0], "rangey": 10.0 * nm[1], "rangez": 1.0, "dz": 0.01, "alpha": angle_deg}
        for name, value in values.items():
            one = out.createVariable(name, "d", ())
            one[...] = value
            one.unit, one.var_unit = "nm", "Ang"  # the unit of the display, and that of the value
        out.flush()
        return file.getvalue()


def mdt(channels: Mapping[str, Floats], nm: tuple[float, float] = (500.0, 250.0), dots: int = 0) -> bytes:
    """NT-MDT: a frame of text, then frames of scanned data, 0.01 nm a step."""
    text = struct.pack("<IH2B6HH", 22 + 8, 3, 1, 2, *[0] * 7) + bytes(8)
    frames = [text]
    for title, heights in channels.items():
        rows, columns = heights.shape
        scales = struct.pack("<ffh", 0.0, nm[0] / columns, -1) + struct.pack("<ffh", 0.0, nm[1] * 1e-3 / rows, -2)
        variables = (scales + struct.pack("<ffh", 0.0, 0.01, -1) + bytes(2)).ljust(80, b"\0")
        body = variables + struct.pack("<4H", 0, columns, rows, dots) + bytes(14 + 16 * dots if dots else 0)
        body += np.round(heights / 0.01).astype("<i2").tobytes()
        body += struct.pack("<I", len(title)) + title.encode() + struct.pack("<I", 0)
        frames.append(struct.pack("<IH2B6HH", 22 + len(body), 0, 1, 2, *[0] * 6, len(variables)) + body)
    head = b"\x01\xb0\x93\xff" + struct.pack("<I4xH", sum(map(len, frames)), len(frames) - 1)
    return head.ljust(33, b"\0") + b"".join(frames)


def park(
    heights: Floats,
    nm: tuple[float, float] = (500.0, 250.0),
    kind: int = 0,
    forward: bool = True,
    up: bool = True,
    swapped: bool = False,
    angle_deg: float = 0.0,
) -> bytes:
    """Park Systems: a small picture in colour, and tags with a header and with heights, 0.01 nm a step."""
    rows, columns = heights.shape
    steps = (heights if up else heights[::-1]) / 0.01
    data = (np.round(steps) if kind < 2 else steps).astype(("<i2", "<i4", "<f4")[kind]).tobytes()

    def wide(text: str) -> bytes:
        return text.encode("utf-16-le")

    header = struct.pack("<i64s16sd2i", 0, wide("Height"), wide("NC-AFM"), 0.0, 0, 0)
    header += struct.pack("<2idid3i", columns, rows, angle_deg, 0, 5.0, forward, up, swapped)
    header += struct.pack("<5d", nm[0] * 1e-3, nm[1] * 1e-3, 0.0, 0.0, 2.5) + struct.pack("<d16s2d", 1.0, b"", 0.0, 0.0)
    header += struct.pack("<3d16s", 0.01, 1.0, 0.0, wide("nm")).ljust(348 - len(header), b"\0") + struct.pack(
        "<i", kind
    )
    own = {50432: (4, struct.pack("<I", 0x0E031301)), 50433: (4, struct.pack("<I", 0x01000002))}
    own |= {50434: (7, data), 50435: (7, header.ljust(580, b"\0"))}
    out = bytearray(b"II*\0" + struct.pack("<I", 8))
    plain = {256: 8, 257: 8, 258: 8, 259: 1, 262: 2, 277: 3, 278: 8, 279: 192}
    beyond = 8 + 2 + 12 * (len(plain) + len(own) + 1) + 4
    entries = {code: struct.pack("<HHII", code, 4, 1, value) for code, value in plain.items()}
    entries[273] = struct.pack("<HHII", 273, 4, 1, beyond)
    far = bytes(192)
    for code, (tag_kind, value) in own.items():
        if len(value) <= 4:
            entries[code] = struct.pack("<HHI", code, tag_kind, 1) + value
            continue
        entries[code] = struct.pack("<HHII", code, tag_kind, len(value), beyond + len(far))
        far += value
    out += struct.pack("<H", len(entries)) + b"".join(entries[code] for code in sorted(entries)) + bytes(4) + far
    return bytes(out)


def h5_jpk() -> bytes:
    """JPK's HDF5, by h5py with the old layout: height and measuredHeight, then the retrace of height, 2 frames each.

    A stopped scan of 34 of 40 rows, 40 columns, at 90 degrees. The first array has chunks of (500, 2) with a checksum,
    the second no chunks, the third chunks of a frame, as JPK has. The integers are those of `h5_jpk_steps`.
    """
    stored = json.loads(Path(__file__).with_name("h5_jpk.json").read_text("utf-8"))["lines"]
    return zlib.decompress(b85decode("".join(stored)))


def h5_jpk_steps(channel: int, frame: int) -> Floats:
    """The integers of a channel of `h5_jpk`; a step is -2e-14 m from 3e-7 m."""
    row, column = np.mgrid[:34, :40]
    return (3.0 * row + 2.0 * column + 5.0 * frame + 11.0 * channel) * 1000.0 - 50000.0

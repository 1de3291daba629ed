"""What a build plays, worked out from its manifest alone in plain Python integers, without the package."""

from fractions import Fraction
from math import sin, tau
from typing import Any

from building import fourier_words

Json = dict[str, Any]


def floor_shift(value: int, bits: int) -> int:
    """round(value / 2^bits), ties up, by division instead of a shift."""
    doubled: int = 2 * value + 2**bits
    return doubled // (1 << (bits + 1))


def played_codes(axis: Json) -> list[int]:
    """Every code of a period, in plain Python integers, from the manifest alone."""
    table, output, line = axis["table"], axis["output"], axis["line"]
    words, guard = table["words"], table["guard_bits"]
    period = line["ticks"] // line["hold_ticks"]
    assert period * line["hold_ticks"] == line["ticks"]
    codes = []
    for k in range(period):
        if table["mode"] == "direct":
            sample = words[k] * 2**guard
        elif table["mode"] == "cubic":
            place = k * 2**32 // period * len(words) // 2**14
            c = [words[(place // 2**18 + i) % len(words)] for i in range(4)]
            sample = 16 * (c[3] - 3 * c[2] + 3 * c[1] - c[0])
            for lower in (24 * (c[0] - 2 * c[1] + c[2]), 12 * (c[2] - c[0]), 2 * (c[0] + 4 * c[1] + c[2])):
                sample = lower + floor_shift(sample * (place % 2**18), 19)
        else:
            # floor(k 2^32 / period) in words of the table, with 15 bits of fraction.
            place = k * 2**32 // period * len(words) // 2**17
            here, there = words[place // 2**15], words[(place // 2**15 + 1) % len(words)]
            sample = here * 2**guard + floor_shift((there - here) * (place % 2**15), 15 - guard)
        code = floor_shift(output["gain_word"] * sample + output["offset_word"], output["gain_q"])
        codes.append(min(max(code, output["code_min"]), output["code_max"]))
    return [code for code in codes for _ in range(line["hold_ticks"])]


def memories(manifest: Json) -> dict[str, tuple[list[int], int]]:
    """Words and bits of every memory of a build, by its name; those of the program are unsigned."""
    found: dict[str, tuple[list[int], int]] = {}
    for name, axis in manifest["axes"].items():
        found[name] = axis["table"]["words"], axis["table"]["bits"]
        found[f"{name}_fourier"] = fourier_words(axis), 32
    found["program"] = _registers(manifest), 32
    tables = [axis["table"] for axis in manifest["axes"].values()]
    lengths = [len(table["words"]) for table in tables if table["mode"] != "direct"]
    if lengths:
        longest = max(lengths)
        found["sine"] = [round(2**30 * sin(tau * j / longest)) for j in range(longest // 4)], 32
    return found


def _registers(manifest: Json) -> list[int]:
    """The 48 registers of the map in docs/verilog.md."""
    sequence, pages = manifest["sequence"], []
    scan = [sequence[key] for key in ("line_ticks", "frame_lines", "settle_lines", "turn_tick")]
    for key in ("forward_ticks", "backward_ticks", "up_lines", "down_lines"):
        scan += sequence[key]
    pages.append([*scan, sequence["pixels"], int(manifest["axes"]["y"]["line"]["hold_ticks"] > 1)])
    for name in "xy":
        line, output = (manifest["axes"][name][key] for key in ("line", "output"))
        advances = line["ticks"] // line["hold_ticks"]
        offset = output["offset_word"]
        page = [2**32 // advances, 2**32 % advances, advances, output["gain_word"], offset % 2**18, offset // 2**18]
        pages.append([*page, *(output[key] for key in ("code_min", "code_max", "max_step", "park_code"))])
    return [word % 2**32 for page in pages for word in page + [0] * (16 - len(page))]


def seconds(manifest: Json, ticks: int) -> list[float]:
    """The time of each tick."""
    rate = Fraction(*manifest["sequence"]["update_rate_hz"])
    return [float(k / rate) for k in range(ticks)]


def markers(manifest: Json, axis: str) -> list[dict[str, bool]]:
    """The markers of each tick of a period of an axis."""
    sequence, found = manifest["sequence"], []
    line_ticks = sequence["line_ticks"]
    if axis == "x":
        windows, turn = [sequence["forward_ticks"], sequence["backward_ticks"]], sequence["turn_tick"]
    else:
        windows, turn = [sequence["up_lines"], sequence["down_lines"]], sequence["turn_line"]
    for k in range(manifest["axes"][axis]["line"]["ticks"]):
        at = k % line_ticks if axis == "x" else k // line_ticks
        pixel = inside = False
        for first, count in windows:
            i = at - first
            if 0 <= i < count:
                inside = True
                pixels = sequence["pixels"]
                pixel = axis == "x" and (i == 0 or i * pixels // count > (i - 1) * pixels // count)
        found.append(
            {"start": k == 0, "line": k % line_ticks == 0, "pixel": pixel, "backward": at >= turn, "inside": inside}
        )
    return found

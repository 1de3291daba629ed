"""What is compared of a scan or a build: what was asked, what is played, what is promised, what it takes."""

from collections.abc import Iterator

import msgspec

from tablegen.comparison.quantity import ComparedQuantity, digest, keys_of
from tablegen.comparison.scanners import scanner_quantities
from tablegen.emit.constants import storage_bits
from tablegen.html_report.subject import PlannedScan, Subject
from tablegen.manifest.fields import ManifestAxis, ManifestFigure, ManifestSequence

_PARTS = (
    ("uncompensated", "scaling error {}, uncompensated"),
    ("total", "scaling error {}, compensated"),
    ("band_limit", "scaling error {}, of the band limit"),
    ("quantisation", "scaling error {}, of quantisation"),
    ("model", "scaling error {}, of the model"),
    ("size", "size error {}"),
)


def scan_quantities(subject: Subject) -> list[ComparedQuantity]:
    """Every quantity of a scan or a build, in the order in which they are told."""
    found = [*_asked(subject.planned)] if subject.planned is not None else []
    found += _rates(subject.manifest.sequence)
    axes = (("x", subject.manifest.axes.x), ("y", subject.manifest.axes.y))
    for axis, entry in axes:
        found.append(ComparedQuantity(f"{axis} drive", "motion", "rests" if entry.resting else "moves"))
        if entry.resting:
            found.append(ComparedQuantity(f"{axis} drive", "offset", entry.drive.v_offset, "V"))
            continue
        found += _corrections(axis, entry)
        found += _waveform(axis, entry)
        found += _certificate(axis, entry)
        found += _expected(axis, entry)
        found += _output(axis, entry)
    manifest = subject.manifest
    found += _memory(subject)
    found += [
        ComparedQuantity("build", "name", manifest.name),
        ComparedQuantity("build", "formats", ", ".join(manifest.formats) or "c, verilog"),
        ComparedQuantity("build", "tablegen", manifest.tablegen),
        ComparedQuantity("build", "plan", manifest.hash[:16]),
        ComparedQuantity("build", "files", f"{len(manifest.files)}: {digest(sorted(manifest.files.items()))}"),
    ]
    if subject.planned is not None:
        found += scanner_quantities(subject.planned.setup.scanner_file, subject.planned.setup.scanner)
    return found


def _asked(planned: PlannedScan) -> Iterator[ComparedQuantity]:
    """The scan file but for the path of the scanner file, whose values are compared."""
    asked = msgspec.to_builtins(planned.setup.scan)
    yield from keys_of("asked for", "", {key: value for key, value in asked.items() if key not in ("name", "scanner")})


def _rates(sequence: ManifestSequence) -> Iterator[ComparedQuantity]:
    schedule = sequence.schedule
    numbers: list[tuple[str, float, str]] = [
        ("line rate", float(schedule.line_rate), "Hz"),
        ("frame rate", float(schedule.frame_rate), "Hz"),
        ("update rate", sequence.update_rate_hz[0] / sequence.update_rate_hz[1], "Hz"),
        ("ticks per line", sequence.line_ticks, ""),
        ("lines per frame", sequence.frame_lines, ""),
        ("pixels per line", sequence.pixels, ""),
        *(
            (name.format(what), pair[at], "")
            for what, pair in (
                ("ticks imaged forward", sequence.forward_ticks),
                ("ticks imaged backward", sequence.backward_ticks),
                ("lines imaged up", sequence.up_lines),
                ("lines imaged down", sequence.down_lines),
            )
            for at, name in ((1, "{}"), (0, "{}, first"))
        ),
        ("lines to settle", sequence.settle_lines, ""),
    ]
    for name, value, unit in numbers:
        yield ComparedQuantity("rates", name, value, unit)


def _corrections(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    """From the size to the volts at the piezo, factor by factor."""
    section, drive = f"{axis} drive", entry.drive
    numbers = (
        ("line", drive.size_nm, "nm"),
        ("imaged", drive.window_nm, "nm"),
        ("offset", drive.v_offset, "V"),
        ("V_scan, by the size (9), (12)", drive.v_scan, "V"),
        ("m, of the offset (1)", drive.m, ""),
        ("g, of the rate (23)", drive.g, ""),
        ("drive, peak to peak", drive.v_amplitude, "V"),
        ("turn", drive.turn, ""),
    )
    for name, value, unit in numbers:
        yield ComparedQuantity(section, name, value, unit)
    yield ComparedQuantity(section, "model", drive.model)
    for side, branch in (("forward", drive.forward), ("backward", drive.backward)):
        yield ComparedQuantity(section, f"beta {side}", branch.beta)
        yield ComparedQuantity(section, f"u_peak {side}", branch.u_peak)
    if drive.resonance is not None:
        yield ComparedQuantity(section, "resonance", drive.resonance.hz, "Hz")
    for name, sha256 in (drive.model_files or {}).items():
        yield ComparedQuantity(section, name, sha256[:16])


def _waveform(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    section, fourier = f"{axis} waveform", entry.fourier
    rate = entry.line.rate_exact[0] / entry.line.rate_exact[1]
    yield ComparedQuantity(section, "band limit", f"{fourier.band_limit}, {fourier.directions}")
    yield ComparedQuantity(section, "harmonics", fourier.harmonics)
    yield ComparedQuantity(section, "highest frequency", fourier.harmonics * rate, "Hz")
    yield ComparedQuantity(section, "window from", fourier.window[0])
    yield ComparedQuantity(section, "window to", fourier.window[1])
    yield ComparedQuantity(section, "harmonics held back", len(fourier.held_harmonics))
    learnt = fourier.refinement
    yield ComparedQuantity(section, "harmonics of the refinement", 0 if learnt is None else len(learnt.a))
    yield ComparedQuantity(section, "coefficients", digest([fourier.a0, fourier.a, fourier.b]))
    yield ComparedQuantity(section, "Fourier words", digest([int(word) for word in entry.fourier_words]))


def _certificate(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    section, found = f"{axis} certificate", entry.certificate
    for side, errors in (found.scaling_error_percent or {}).items():
        for part, name in _PARTS:
            if part in errors:
                yield ComparedQuantity(section, name.format(side), errors[part], "%")
    for side, moved in (found.refinement_percent or {}).items():
        for part, value in moved.items():
            yield ComparedQuantity(section, f"refinement {side}, {part}", value, "%")
    of = "a code" if found.shaped is None else "the position"
    numbers = (
        (f"largest error of {of}", found.max_error_lsb, "LSB"),
        (f"rms error of {of}", found.rms_error_lsb, "LSB"),
        ("lowest code", found.lowest_code, ""),
        ("highest code", found.highest_code, ""),
        ("room below", found.headroom_low, "codes"),
        ("room above", found.headroom_high, "codes"),
        ("largest step", found.largest_step, "codes"),
        ("steepest slope", found.peak_slew_v_per_s, "V/s"),
        ("power beyond the cutoff", found.beyond_cutoff_db, "dB"),
        ("power at the resonance", found.at_resonance_db, "dB"),
    )
    for name, number, unit in numbers:
        if number is not None:
            yield ComparedQuantity(section, name, number, unit)
    if found.shaped is not None:
        yield ComparedQuantity(section, "rms error of a code", found.shaped.rms_code_error_lsb, "LSB")
        yield ComparedQuantity(section, "ticks on which the code changes", found.shaped.changes.percent, "%")


def _expected(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    """What the model expects on the scanner; what that is uncertain by holds for 90 % of scans."""
    expected = entry.certificate.expected
    if expected is None:
        return
    section = f"{axis} on the scanner"
    yield ComparedQuantity(section, "expected by", "the operator" if expected.basis == "traces" else "the laws")
    figures: list[tuple[str, ManifestFigure | None]] = [
        *((f"rms residual {side}", figure) for side, figure in expected.rms_percent.items()),
        *((f"scaling error {side}", figure) for side, figure in expected.scaling_percent.items()),
        ("trace to retrace", expected.mismatch_percent),
        ("size error", expected.size_percent),
    ]
    for name, figure in figures:
        if figure is not None:
            yield ComparedQuantity(section, name, figure.value, "%")
            if figure.uncertainty is not None:
                yield ComparedQuantity(section, f"{name}, uncertain by", figure.uncertainty, "%")
    if expected.distance_percent is not None:
        yield ComparedQuantity(section, "distance to the nearest trace", expected.distance_percent, "% of v_max")


def _memory(subject: Subject) -> Iterator[ComparedQuantity]:
    """What a device stores. In C the words of all tables have one type, and a table has one word more than it plays."""
    axes = subject.manifest.axes.x, subject.manifest.axes.y
    tables = [entry.table for entry in axes]
    bits = storage_bits(max(table.bits for table in tables))
    for axis, table in zip(("x", "y"), tables, strict=True):
        yield ComparedQuantity("memory", f"{axis} table", table.mode)
        yield ComparedQuantity("memory", f"{axis} table, bits a word", table.bits)
        yield ComparedQuantity("memory", f"{axis} table, words", len(table.words))
        yield ComparedQuantity("memory", f"{axis} table, content", digest(table.words))
        if table.asked is not None:
            yield ComparedQuantity("memory", f"{axis} table, chosen for an error", table.asked.max_error_lsb, "LSB")
    yield ComparedQuantity("memory", "tables in an FPGA", sum(len(one.words) * one.bits for one in tables), "bits")
    yield ComparedQuantity("memory", "tables in C", sum(len(one.words) + 1 for one in tables) * bits // 8, "bytes")
    words = sum(len(entry.fourier_words) for entry in axes)
    yield ComparedQuantity("memory", "Fourier words in C", 4 * words, "bytes")


def _output(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    """The converter and the limits that the device keeps."""
    section, output = f"{axis} limits", entry.output
    numbers = (
        ("lowest code allowed", output.code_min, ""),
        ("highest code allowed", output.code_max, ""),
        ("largest step allowed", output.max_step, "codes"),
        ("park code", output.park_code, ""),
        ("gain word", output.gain_word, ""),
        ("offset word", output.offset_word, ""),
        ("volts at code 0", output.v_zero, "V"),
        ("an LSB at the piezo", output.v_per_code, "V"),
        ("converter", output.dac_bits, "bits"),
    )
    for name, value, unit in numbers:
        yield ComparedQuantity(section, name, value, unit)
    yield ComparedQuantity(section, "coding", output.coding)
    if output.shaping is not None:
        yield ComparedQuantity(section, "order of shaping", output.shaping.order)
        yield ComparedQuantity(section, "zero of shaping", output.shaping.zero)
    if output.channel:
        yield ComparedQuantity(section, "output of the converter", output.channel)
    yield ComparedQuantity(section, "word", f"{output.word_bits} bits, {output.align}")

"""The compared quantities of a scan or a build: the request, the waveform, the certificate, the memory."""

from collections.abc import Iterator

import msgspec

from tablegen.comparison.quantity import ComparedQuantity, digest, keys_of
from tablegen.comparison.scanners import scanner_quantities
from tablegen.config.load import Setup
from tablegen.emit.constants import storage_bits
from tablegen.html_report.subject import Subject
from tablegen.manifest.fields import ManifestAxis, ManifestFigure, ManifestOutput, ManifestSequence

_PARTS = (
    ("uncompensated", "scaling error {}, uncompensated"),
    ("total", "scaling error {}, compensated"),
    ("band_limit", "scaling error {}, of the band limit"),
    ("quantisation", "scaling error {}, of quantisation"),
    ("model", "scaling error {}, of the model"),
    ("size", "size error {}"),
)


def scan_quantities(subject: Subject) -> list[ComparedQuantity]:
    """Return every quantity of a scan or a build, in the order of the report."""
    quantities = [*request_keys(subject.planned.setup)] if subject.planned is not None else []
    quantities += rates(subject.manifest.sequence)
    axes = (("x", subject.manifest.axes.x), ("y", subject.manifest.axes.y))
    for axis, entry in axes:
        quantities.append(ComparedQuantity(f"{axis} drive", "motion", _motion(entry)))
        if entry.resting:
            quantities.append(ComparedQuantity(f"{axis} drive", "offset", entry.drive.v_offset, "V"))
            continue
        quantities += _corrections(axis, entry)
        quantities += _waveform(axis, entry)
        quantities += _certificate(axis, entry)
        quantities += _pixels(axis, entry, subject.manifest.sequence)
        quantities += _expected(axis, entry)
        quantities += output_limits(axis, entry.output)
    manifest = subject.manifest
    quantities += _memory(subject)
    quantities += [
        ComparedQuantity("build", "name", manifest.name),
        ComparedQuantity("build", "formats", ", ".join(manifest.formats) or "c, verilog"),
        ComparedQuantity("build", "tablegen", manifest.tablegen),
        ComparedQuantity("build", "plan", manifest.hash[:16]),
        ComparedQuantity("build", "files", f"{len(manifest.files)}: {digest(sorted(manifest.files.items()))}"),
    ]
    if subject.planned is not None:
        quantities += scanner_quantities(subject.planned.setup.scanner_file, subject.planned.setup.scanner)
    return quantities


def request_keys(setup: Setup) -> Iterator[ComparedQuantity]:
    """Yield the keys of the scan file except the path of the scanner file, whose values are compared."""
    values = msgspec.to_builtins(setup.scan)
    yield from keys_of("asked for", "", {key: value for key, value in values.items() if key not in ("name", "scanner")})


def rates(sequence: ManifestSequence) -> Iterator[ComparedQuantity]:
    """Yield rates, and which ticks and lines are imaged."""
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


def _motion(entry: ManifestAxis) -> str:
    if entry.resting:
        return "rests"
    return "moves" if entry.fourier.place is None else "moves as a sine"


def _corrections(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    """Yield the factors from the size to the volts at the piezo."""
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
    low, high = fourier.imaged or fourier.window  # of a sine as the scan file has it
    yield ComparedQuantity(section, "window from", low)
    yield ComparedQuantity(section, "window to", high)
    yield ComparedQuantity(section, "harmonics held back", len(fourier.held_harmonics))
    refinement = fourier.refinement
    yield ComparedQuantity(section, "harmonics of the refinement", 0 if refinement is None else len(refinement.a))
    yield ComparedQuantity(section, "coefficients", digest([fourier.a0, fourier.a, fourier.b]))
    yield ComparedQuantity(section, "Fourier words", digest([int(word) for word in entry.fourier_words]))


def _certificate(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    section, certificate = f"{axis} certificate", entry.certificate
    for side, errors in (certificate.scaling_error_percent or {}).items():
        for part, name in _PARTS:
            if part in errors:
                yield ComparedQuantity(section, name.format(side), errors[part], "%")
    for side, changes in (certificate.refinement_percent or {}).items():
        for part, value in changes.items():
            yield ComparedQuantity(section, f"refinement {side}, {part}", value, "%")
    if certificate.position is not None:
        for side, value in certificate.position.scaling_error_percent.items():
            yield ComparedQuantity(section, f"scaling error {side}, with the resonance", value, "%")
        yield ComparedQuantity(section, "largest error behind the resonance", certificate.position.max_error_lsb, "LSB")
        yield ComparedQuantity(section, "rms error behind the resonance", certificate.position.rms_error_lsb, "LSB")
        yield ComparedQuantity(section, "response", digest(certificate.position.passage))
    of = "a code" if certificate.shaped is None else "the position"
    numbers = (
        (f"largest error of {of}", certificate.max_error_lsb, "LSB"),
        (f"rms error of {of}", certificate.rms_error_lsb, "LSB"),
        ("lowest code", certificate.lowest_code, ""),
        ("highest code", certificate.highest_code, ""),
        ("room below", certificate.headroom_low, "codes"),
        ("room above", certificate.headroom_high, "codes"),
        ("largest step", certificate.largest_step, "codes"),
        ("steepest slope", certificate.peak_slew_v_per_s, "V/s"),
        ("power beyond the cutoff", certificate.beyond_cutoff_db, "dB"),
        ("power at the resonance", certificate.at_resonance_db, "dB"),
    )
    for name, number, unit in numbers:
        if number is not None:
            yield ComparedQuantity(section, name, number, unit)
    if certificate.shaped is not None:
        yield ComparedQuantity(section, "rms error of a code", certificate.shaped.rms_code_error_lsb, "LSB")
        yield ComparedQuantity(section, "ticks on which the code changes", certificate.shaped.changes.percent, "%")


def _pixels(axis: str, entry: ManifestAxis, sequence: ManifestSequence) -> Iterator[ComparedQuantity]:
    """Yield lengths and errors of pixels that are taken where the piezo is; nothing where they have equal lengths."""
    pixels, table = entry.certificate.pixels, sequence.pixel_table
    if pixels is None or table is None:
        return
    section = f"{axis} pixels"
    for side, counts in zip(("forward", "backward"), table, strict=True):
        yield ComparedQuantity(section, f"shortest {side}", min(counts), "ticks")
        yield ComparedQuantity(section, f"longest {side}", max(counts), "ticks")
        yield ComparedQuantity(section, f"table {side}", digest(counts))
        yield ComparedQuantity(section, f"rms error {side}", pixels.rms_percent[side], "%")
        yield ComparedQuantity(section, f"largest error {side}", pixels.worst_percent[side], "%")
        yield ComparedQuantity(section, f"scaling error {side}", pixels.scaling_percent[side], "%")
    yield ComparedQuantity(section, "trace to retrace", pixels.mismatch_percent, "%")


def _expected(axis: str, entry: ManifestAxis) -> Iterator[ComparedQuantity]:
    """Yield the errors that the model expects on the scanner; the uncertainty holds for 90 % of scans."""
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
    if expected.stroke is not None:
        yield ComparedQuantity(section, "branches at the stroke that is played", digest(expected.stroke))
    if expected.distance_percent is not None:
        yield ComparedQuantity(section, "distance to the nearest trace", expected.distance_percent, "% of v_max")


def _memory(subject: Subject) -> Iterator[ComparedQuantity]:
    """Yield the memory of a device. Tables in C have one type for both axes, and one word more than they play."""
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


def output_limits(axis: str, output: ManifestOutput) -> Iterator[ComparedQuantity]:
    """Yield the converter and the limits that the device enforces."""
    section = f"{axis} limits"
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

"""Columns of other programs: names and units in their usual spellings, choices by number, volts before an amplifier."""

from pathlib import Path

import numpy as np
import pytest

from tablegen.api.measured import table_of
from tablegen.base.input_errors import Rejected
from tablegen.calibration.tables.columns import (
    APPARENT,
    DISPLACEMENT,
    DRIVE,
    FREQUENCY,
    GAIN,
    OFFSET,
    PHASE,
    SIZE,
    TIME,
)
from tablegen.calibration.tables.recorder import Recorder
from tablegen.calibration.tables.table import MeasuredTable

TRACE = (TIME, DRIVE, DISPLACEMENT)
ROWS = ((0.25, 1.5, 120.0), (0.5, 2.5, 250.0))


def read(folder: Path, content: str, recorder: Recorder | None = None) -> MeasuredTable:
    path = folder / "trace.csv"
    path.write_text(content, "utf-8")
    return (recorder or Recorder()).read(path, TRACE)


def refused(folder: Path, content: str, recorder: Recorder | None = None) -> list[str]:
    with pytest.raises(Rejected) as caught:
        read(folder, content, recorder)
    return [str(problem).replace(f"{folder}/", "") for problem in caught.value.problems]


@pytest.mark.parametrize(
    "content",
    [
        "Time (s),DAC out [V],Position (um)\n0.25,1.5,0.12\n0.5,2.5,0.25\n",
        "Time (s),DAC out [V],Position (\u00b5m)\n0.25,1.5,0.12\n0.5,2.5,0.25\n",
        "Time (s),Voltage (mV),Sensor [\u03bcm]\n0.25,1500,0.12\n0.5,2500,0.25\n",
        "time_ms,drive_kv,displacement_mm\n250,0.0015,0.00012\n500,0.0025,0.00025\n",
        "Time / ms;Drive / V;Pos / nm\n250;1,5;120\n500;2,5;250\n",
        "t in us\tPiezo voltage in V\tStage position in microns\n250000\t1,5\t0,12\n500000\t2,5\t0,25\n",
        "\ufeff# a scope\n# of somebody\nTime,Drive,Pos\n(ms),(V),(um)\n250,1.5,0.12\n500,2.5,0.25\n",
        "# time_s,drive_v,displacement_nm\n0.25,1.5,120\n0.5,2.5,250\n",
        "DriveVoltage_V,PositionX_um,TIME_S\n1.5,0.12,0.25\n2.5,0.25,0.5\n",
        "time_s,setpoint (V),drive_v,displacement_nm,Position (um)\n0.25,9,1.5,120,9\n0.5,9,2.5,250,9\n",
        "Time (seconds),Command (volts),Measured position (metres)\n0.25,1.5,1.2e-7\n0.5,2.5,2.5e-7\n",
    ],
)
def test_usual_spellings_are_read(content: str, tmp_path: Path) -> None:
    table = read(tmp_path, content)
    for column, values in zip(TRACE, np.transpose(ROWS), strict=True):
        assert table[column] == pytest.approx(values, rel=1e-12)
    assert table.remarks == ()


def test_a_header_without_units_is_read_with_a_remark(tmp_path: Path) -> None:
    table = read(tmp_path, "Time;Drive;Pos\n0,25;1,5;120\n0,5;2,5;250\n")
    assert table[DISPLACEMENT] == pytest.approx([120.0, 250.0])
    (remark,) = table.remarks
    assert remark.code == "assumed-unit"
    assert "states no unit of Time, Drive, Pos: taken as s, V, nm" in remark
    assert "--columns displacement=COLUMN:UNIT" in remark


def test_other_quantities(tmp_path: Path) -> None:
    path = tmp_path / "response.csv"
    path.write_text("Freq (kHz),Magnitude (dB),Phase [\u00b0]\n1.5,20,-90\n", "utf-8")
    table = Recorder().read(path, (FREQUENCY, GAIN), (PHASE,))
    assert [float(table[one][0]) for one in (FREQUENCY, GAIN, PHASE)] == pytest.approx([1500.0, 10.0, -90.0])


@pytest.mark.parametrize(
    ("content", "faults"),
    [
        (
            "Time (s),Drive (V),Position x (um),Position y (um)\n0,1,2,3\n",
            [
                "trace.csv:1: displacement_nm: Position x (um) and Position y (um) may each be the displacement; keep "
                "one of them, or choose it: --columns displacement=NAME"
            ],
        ),
        (
            "# a\nTime (s),Drive (V),Sensor (V)\n0,1,2\n",
            [
                "trace.csv:2: Sensor (V): 'V' is no unit of displacement; it takes nm, pm, um, mm, m: multiply the "
                "volts of a sensor by its nm per volt first, or choose it: --columns displacement=NAME:UNIT"
            ],
        ),
        (
            "Time (fortnights),Drive (V),Pos (um)\n0,1,2\n",
            [
                "trace.csv:1: Time (fortnights): 'fortnights' is no unit of time; it takes s, ms, us, ns, or choose "
                "it: --columns time=NAME:UNIT"
            ],
        ),
    ],
)
def test_what_is_ambiguous_is_refused_with_line_names_and_remedy(
    content: str, faults: list[str], tmp_path: Path
) -> None:
    assert refused(tmp_path, content) == faults


def test_a_size_without_volts_is_no_scan_voltage(tmp_path: Path) -> None:
    for cell, has_it in (("Size", False), ("Size (nm)", False), ("Scan size [V]", True)):
        path = tmp_path / "offsets.csv"
        path.write_text(f"Offset (V),apparent_nm,{cell}\n7,16,20\n", "utf-8")
        assert (SIZE in Recorder().read(path, (OFFSET, APPARENT), (SIZE,))) == has_it


def test_millihertz_are_not_guessed(tmp_path: Path) -> None:
    path = tmp_path / "response.csv"
    path.write_text("Frequency (mHz),gain\n1500,1\n", "utf-8")
    with pytest.raises(Rejected, match=r"csv:1: Frequency \(mHz\): 'mHz' is no unit of frequency \(milli or mega\?\)"):
        Recorder().read(path, (FREQUENCY, GAIN))


@pytest.mark.parametrize(
    ("columns", "header"),
    [
        ("time=3,drive=2,position=1:um", ""),
        ("time=3,drive=2,position=1", "a (um);b (V);c (s)\n"),
        ("t=Clock,drive=b,pos=A:um", "a;b;clock\n"),
        ({"time": 3, "drive": "b", "displacement": "1:um"}, "a;b;c\n"),
    ],
)
def test_columns_by_choice(columns: str | dict[str, str | int], header: str, tmp_path: Path) -> None:
    table = read(tmp_path, f"{header}0,12;1,5;0,25\n0,25;2,5;0,5\n", Recorder(columns))
    for column, values in zip(TRACE, np.transpose(ROWS), strict=True):
        assert table[column] == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize(
    ("columns", "fault"),
    [
        ("time=4,drive=2,position=1", "trace.csv:1: time_s: --columns time=4: the file has 3 columns"),
        ("time=u", "trace.csv:1: time_s: --columns time=u: no column of this name; the header has a, b, c"),
        ("speed=1", "--columns: 'speed' is none of time, drive, displacement"),
        ("time", "--columns: 'time': give QUANTITY=COLUMN; quantities are time, drive, displacement"),
        ("time=1,drive=1", "--columns: two quantities are of one column"),
        ("time=1,t=2", "--columns: time is given twice"),
        ("pos=1:V", "--columns: 'V' is no unit of displacement; it takes nm, pm, um, mm, m"),
    ],
)
def test_choices_that_are_wrong(columns: str, fault: str, tmp_path: Path) -> None:
    assert refused(tmp_path, "a;b;c\n1;2;3\n", Recorder(columns))[0] == fault


def test_volts_before_the_amplifier(tmp_path: Path) -> None:
    """A gain and an offset make volts at the piezo; differences of volts take no offset."""
    assert read(tmp_path, "time_s,drive_v,displacement_nm\n0,1.5,1\n", Recorder(None, 20.0, 3.0))[DRIVE] == 33.0
    sizes = table_of({"drive_v": [2.0], "size_v": [1.0]}, [DRIVE, SIZE], (), Recorder(None, -20.0, 3.0), True)
    assert (sizes[DRIVE], sizes[SIZE]) == (40.0, 20.0)
    assert table_of({"offset_v": [2.0]}, [OFFSET], (), Recorder(None, -20.0, 3.0))[OFFSET] == -37.0
    with pytest.raises(Rejected, match="has no column of voltages"):
        table_of({"frequency_hz": [1.0], "gain": [1.0]}, [FREQUENCY, GAIN], (), Recorder(None, 20.0))
    for gain, offset in ((0.0, 0.0), (float("nan"), 0.0), (1.0, float("inf"))):
        with pytest.raises(ValueError, match=r"a drive (gain|offset) of"):
            Recorder(None, gain, offset)


def test_arrays_have_the_names_of_a_header() -> None:
    table = table_of({"t": [1.0], "Position (um)": [2.0], "voltage_mv": [5.0]}, TRACE)
    assert [float(table[column][0]) for column in TRACE] == pytest.approx([1.0, 5e-3, 2000.0])

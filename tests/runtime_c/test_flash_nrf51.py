"""The driver of a flash of a chip, ``flash_nrf51``: in QEMU, whose micro:bit is not ours, and on a stricter model.

QEMU's flash is written where CONFIG allows it, by words, and only clears bits; it forgets nothing at a reset.
"""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

import pytest
from building import HELPERS, REPOSITORY, Variant, run_clean, run_warned, write_variant
from cut_flash import CutFlash
from kept_commands import SCAN, SIZES_NM
from limits import PATIENCE_S
from line_log import LineCheck
from link_qemu import LinkMachine
from nrf51_flash import KEPT, KEPT_END, PAGE, SCRATCH, Nrf51Flash
from sets import long
from store_cuts import SCRIPT, Step, image_of, take_by_model

from tablegen.base.resources import c_link, c_store
from tablegen.config.load import load
from tablegen.link.device import Device
from tablegen.link.errors import Refused
from tablegen.link.messages import DeviceState
from tablegen.link.prepare import PreparedScan
from tablegen.link.store import LINE, Layout, Store
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.rest

FIRMWARE = REPOSITORY / "examples" / "firmware"
DRIVER = Path("flash") / "flash_nrf51.c"
SLOW = {**SCAN, "dac.update_rate_hz": 2e3, "timing": {**SCAN["timing"], "line_rate_hz": 6.0}}
# What a fault replaces in the driver. QEMU finds these,
IN_QEMU = {
    "writing is not enabled": ("configure(WRITE)", "configure(READ_ONLY)"),
    "erasing is not enabled": ("configure(ERASE)", "configure(WRITE)"),
    "nothing is erased, nor looked at": (
        "    NVMC_ERASEPAGE = address;\n    return configure(READ_ONLY) && erased(address);",
        "    return configure(READ_ONLY) && (erased(address) || true);"),
    "the page before is erased": ("NVMC_ERASEPAGE = address;", "NVMC_ERASEPAGE = address - FLASH_NRF51_PAGE;"),
}  # fmt: skip
# and the stricter model these and all of the next.
FAULTS = {
    **IN_QEMU,
    "words have the other byte order": (
        "(uint32_t)bytes[at] | (uint32_t)bytes[at + 1] << 8 | (uint32_t)bytes[at + 2] << 16\n"
        "                            | (uint32_t)bytes[at + 3] << 24",
        "(uint32_t)bytes[at + 3] | (uint32_t)bytes[at + 2] << 8 | (uint32_t)bytes[at + 1] << 16\n"
        "                            | (uint32_t)bytes[at] << 24"),
    "half a line is written": ("good && at < DAC_STORE_LINE", "good && at < DAC_STORE_LINE / 2"),
    "bytes are written": ("REGISTER(address + at) = word;",
                          "for (unsigned i = 0; i < WORD; i++)\n"
                          "            *(volatile uint8_t *)(uintptr_t)(address + at + i) = bytes[at + i];"),
    "a write is not waited for": ("good = wait_until_ready() && REGISTER", "good = REGISTER"),
    "nothing is waited for": ("(NVMC_READY & READY) != 0", "NVMC_READY < 2"),
    "CONFIG is changed while an erase goes on": ("if (!wait_until_ready())\n        return false;\n    NVMC", "NVMC"),
    "flash stays writable": ("return configure(READ_ONLY) && good;", "return good;"),
    "flash stays erasable": ("return configure(READ_ONLY) && erased(address);", "return erased(address);"),
    "both are enabled": ("ERASE = 2", "ERASE = 3"),
    "the words of a line are not compared": (" && REGISTER(address + at) == word", ""),
    "a failed write counts": ("return configure(READ_ONLY) && good;", "return configure(READ_ONLY) && (good || true);"),
    "an erased page is not read": ("configure(READ_ONLY) && erased(address)",
                                   "configure(READ_ONLY) && (erased(address) || true)"),
    "only the first word of a page is read": ("at < FLASH_NRF51_PAGE; at += WORD", "at < WORD; at += WORD"),
    "an erase may begin in a page": ("address % FLASH_NRF51_PAGE != 0 || ", ""),
    "an erase may lie elsewhere": ("!within(address, FLASH_NRF51_PAGE)", "!within(kept_page(), FLASH_NRF51_PAGE)"),
    "a write may begin in a word": ("address % WORD != 0 || ", ""),
    "a write may lie elsewhere": ("!within(address, DAC_STORE_LINE)", "!within(kept_page(), DAC_STORE_LINE)"),
    "a read may lie elsewhere": ("!within(address, count)", "!within(kept_page(), count)"),
    "the start is not looked at": ("address >= start && ", "start != 0 && "),
    "the end is not looked at": ("bytes <= end - address", "bytes != 0"),
    "the length is not looked at": ("bytes <= end - address", "(bytes == 0 || address < end)"),
}  # fmt: skip


@dataclass(frozen=True)
class Built:
    """Firmware for a micro:bit, and scans: that of the firmware, and two others."""

    ports: Path
    target: Path
    files: list[Path]
    scans: list[PreparedScan]

    def make(self) -> Path:
        run_warned(
            ["make", "-C", self.ports / "cortex_m", "BOARD=microbit", f"SCAN={self.files[0]}", f"BUILD={self.target}",
             f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines", "STORE=1"]
        )  # fmt: skip
        return self.target / "firmware.elf"

    def make_changed(self, file: Path, old: str, new: str) -> Path:
        """Make it with a piece of the text of a file replaced; only that file is compiled."""
        path = self.ports / file
        text = path.read_text("ascii")
        assert text.count(old) == 1, old
        path.write_text(text.replace(old, new), "ascii")
        try:
            return self.make()
        finally:
            path.write_text(text, "ascii")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    folder = tmp_path_factory.mktemp("microbit")
    ports = folder / "firmware"
    shutil.copytree(FIRMWARE, ports, ignore=shutil.ignore_patterns("build"))
    files = [write_variant(folder / "boot", Variant(SLOW))]
    files += [write_variant(folder / f"{size}", Variant({**SLOW, "x.size_nm": size})) for size in SIZES_NM]
    scans = [PreparedScan.of_plan(make_plan(load(file))) for file in files]
    return Built(ports, folder / "build", files, scans)


@pytest.fixture(scope="module")
def executable(built: Built) -> Path:
    made = built.target.parent / "good.elf"
    shutil.copy(built.make(), made)
    return made


def _starts(machine: LinkMachine, client: Device) -> str:
    """Reset the board, and return the hash of what it starts with."""
    boot = client.status().boot
    machine.reset()
    while (status := client.status()).boot == boot or status.hash is None:
        pass
    return status.hash.hex()


def _play(client: Device) -> None:
    client.arm()
    client.trigger()


def _park(client: Device) -> None:
    client.park()
    client.wait_for(DeviceState.PARKED, PATIENCE_S)


def _plays_as_modelled(machine: LinkMachine, client: Device, scan: PreparedScan) -> None:
    """Play more than a frame of what a start has, from the codes at power-up, and park."""
    check = LineCheck(scan.program)
    assert machine.lines() == []
    _play(client)
    machine.wait_for(lambda line: check.lines > scan.program.schedule.lines, check.follow)
    _park(client)
    check.follow(machine.lines())
    assert check.taken == {1: LineCheck.BOOT}


def _takes_an_upload(machine: LinkMachine, client: Device, boot: PreparedScan, scan: PreparedScan) -> None:
    """Upload a scan while that of the start plays; every line is of one of them."""
    check = LineCheck(boot.program)
    check.offer(scan.digest, scan.program)
    _play(client)
    machine.wait_for(lambda line: check.lines > 2, check.follow)
    client.upload(scan.image("fourier"), timeout_s=PATIENCE_S)
    machine.wait_for(lambda line: check.taken.get(line.generation) == scan.digest, check.follow)
    _park(client)
    check.follow(machine.lines())
    assert set(check.taken.values()) == {LineCheck.BOOT, scan.digest}


def _keep(client: Device, scan: PreparedScan, slot: int) -> None:
    client.upload(scan.image("table"), timeout_s=PATIENCE_S)
    client.save(slot)


@contextmanager
def _microbit(executable: Path) -> Iterator[tuple[LinkMachine, Device]]:
    """A board, and a client that speaks with it."""
    with (
        LinkMachine("microbit", executable, one_uart=True, shift=6) as machine,
        Device(machine.url, timeout_s=PATIENCE_S, random=Random(8)) as client,
    ):
        yield machine, client


def test_scans_are_kept_in_the_flash_of_a_microbit(built: Built, executable: Path, tmp_path: Path) -> None:
    boot, first, second = built.scans
    with _microbit(executable) as (machine, client):
        assert _starts(machine, client) == boot.digest
        _takes_an_upload(machine, client, boot, first)
        client.save(1)
        client.select(1)
        assert _starts(machine, client) == first.digest
        assert client.readback()[192:] == first.image("table").data[192:]
        _play(client)
        with pytest.raises(Refused, match="playing"):  # the processor would stop
            client.select(None)
        _park(client)
        assert _starts(machine, client) == first.digest
        machine.lines()
        _plays_as_modelled(machine, client, first)
        _keep(client, second, 0)
        client.select(0, trial=True)
        assert [_starts(machine, client) for _ in range(2)] == [second.digest, first.digest]
        client.select(0, trial=True)
        assert _starts(machine, client) == second.digest
        client.confirm()
        assert _starts(machine, client) == second.digest
        machine.save_memory(0, KEPT_END, tmp_path / "flash")
        client.delete(0)
        assert _starts(machine, client) == boot.digest
    # Without power, RAM is lost too.
    with _microbit(tmp_path / "flash") as (machine, client):
        client.wait_for(DeviceState.PARKED, PATIENCE_S)
        status = client.status()
        assert (status.boot, status.hash.hex()) == (1, second.digest)
        _plays_as_modelled(machine, client, second)


@pytest.mark.parametrize("fault", long([*IN_QEMU][::2], IN_QEMU))
def test_qemu_finds_a_fault_of_the_driver(fault: str, built: Built, executable: Path) -> None:
    """The device says that it has not kept the scan, or does not start with it."""
    with _microbit(built.make_changed(DRIVER, *IN_QEMU[fault])) as (machine, client):
        try:
            _keep(client, built.scans[1], 1)
            client.select(1)
        except Refused:
            return
        assert _starts(machine, client) != built.scans[1].digest


def test_the_linker_tells_a_region_without_room(built: Built, executable: Path) -> None:
    """A negative control: four pages, of which the records take three."""
    size = "0x00020000, LENGTH = "
    with pytest.raises(AssertionError, match="the sectors of kept programs have no room"):
        built.make_changed(Path("cortex_m") / "microbit.ld", f"{size}128K", f"{size}4K")


# The same driver on the stricter model.


def test_the_page_has_the_number_of_faults() -> None:
    page = " ".join((REPOSITORY / "docs" / "c.md").read_text("utf-8").split())
    assert f"each of {len(FAULTS)} faults of the driver is found" in page


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """All but the driver."""
    folder = tmp_path_factory.mktemp("objects")
    (folder / "memory.ld").write_bytes((FIRMWARE / "cortex_m" / "microbit.ld").read_bytes())
    files = [file for file in [*c_store(), *c_link()] if file.name in ("dac_store.c", "dac_link_frame.c")]
    sources = [*files, HELPERS / "nrf51_store.c", FIRMWARE / "memory.c"]
    return [_compile(source, folder / f"{source.stem}.o") for source in sources]


def _compile(source: Path, target: Path) -> Path:
    run_clean(
        ["arm-none-eabi-gcc", "-std=c99", "-mcpu=cortex-m0", "-mthumb", "-ffreestanding", "-O2", "-Wall", "-Wextra",
         "-DDAC_STORE=1", f"-I{FIRMWARE / 'flash'}", f"-I{c_store()[0].parent}", "-c", source, "-o", target]
    )  # fmt: skip
    return target


def _link(folder: Path, objects: list[Path], fault: tuple[str, str] | None = None) -> Path:
    """Link the driver, or a faulty one, with a store."""
    text = (FIRMWARE / DRIVER).read_text("ascii")
    if fault is not None:
        assert text.count(fault[0]) == 1, fault
        text = text.replace(*fault).replace(
            "static bool within", "#define kept_page() ((uint32_t)(uintptr_t)kept_start)\n\nstatic bool within", 1
        )
    driver, target = folder / "flash_nrf51.c", folder / "store.elf"
    driver.write_text(text, "ascii")
    run_clean(
        ["arm-none-eabi-gcc", "-mcpu=cortex-m0", "-mthumb", "-nostdlib", "-static", f"-L{objects[0].parent}", "-T",
         FIRMWARE / "cortex_m" / "firmware.ld", "-Wl,-e,store_open", *objects,
         _compile(driver, folder / "flash_nrf51.o"), "-lgcc", "-o", target]
    )  # fmt: skip
    return target


LAYOUT = Layout(KEPT, PAGE, place_sectors=2, slots=3)
STEPS: tuple[Step, ...] = (*SCRIPT, ("save", 2, 200), ("confirm",), ("select", 1), ("select", 2), ("start",))


def _take(chip: Nrf51Flash, step: Step) -> int:
    name, *rest = step
    if name == "save":
        image = image_of(rest[1])
        info, data = chip.put(image.info.pack()), chip.put(image.data, SCRATCH + 64)
        return chip.call("store_save", rest[0], info, data)
    if name in ("select", "try"):
        return chip.call("store_select", rest[0], name == "try")
    return chip.call(f"store_{name}", *rest)


def _store_equals_the_model(chip: Nrf51Flash) -> None:
    """After each step the flash has the bytes that the model's has, and nothing was done that the manual forbids."""
    flash = CutFlash(KEPT_END, PAGE)
    model = Store(flash, LAYOUT)
    assert chip.call("store_open") == 0
    for step in STEPS:
        if step[0] == "start":
            model = Store(flash, LAYOUT)
            assert chip.call("store_open") == 0
            assert chip.call("store_start") & 0xFF == model.start()
        else:
            assert (_take(chip, step) == 0) == take_by_model(model, step), step
        assert chip.faults == []
        assert chip.cells == flash.cells[KEPT:], step


def _stays_in_its_region(chip: Nrf51Flash) -> None:
    chip.put(bytes(2 * LINE))
    before = bytes(chip.cells)
    refused = [
        ("flash_nrf51_erase", address) for address in (KEPT - PAGE, KEPT + 4, KEPT_END - 4, KEPT_END, 0, 0xFFFFFC00)
    ]
    refused += [
        ("flash_nrf51_write", address, SCRATCH)
        for address in (KEPT - LINE, KEPT - 4, KEPT + 2, KEPT_END - LINE + 4, KEPT_END, 0, 0xFFFFFFE0)
    ]
    refused += [
        ("flash_nrf51_read", address, SCRATCH, count)
        for address, count in ((KEPT - 4, 8), (KEPT_END - 4, 8), (KEPT_END + 4, 4), (0, 4), (KEPT, 0xFFFFFFFF))
    ]
    for call in refused:
        assert chip.call(*call) & 0xFF == 0, call
    assert (bytes(chip.cells), chip.get(2 * LINE), chip.faults) == (before, bytes(2 * LINE), [])
    for address in (KEPT, KEPT_END - PAGE):
        assert chip.call("flash_nrf51_erase", address) & 0xFF == 1
    line = chip.put(bytes(range(LINE)))
    assert chip.call("flash_nrf51_write", KEPT_END - LINE, line) & 0xFF == 1
    assert chip.call("flash_nrf51_read", KEPT_END - LINE + 1, SCRATCH + LINE, LINE - 1) & 0xFF == 1
    assert (chip.get(LINE - 1, SCRATCH + LINE), chip.faults) == (bytes(range(1, LINE)), [])


def _tells_failures(chip: Nrf51Flash) -> None:
    """Of a word that cannot be written, and of a page that cannot be erased."""
    page, line = KEPT + 5 * PAGE, chip.put(bytes(range(LINE)))
    chip.weak = {page + 12}
    assert chip.call("flash_nrf51_erase", page) & 0xFF == 1
    assert chip.call("flash_nrf51_write", page, line) & 0xFF == 0
    page += PAGE
    assert chip.call("flash_nrf51_write", page + PAGE - LINE, line) & 0xFF == 1
    chip.worn = {page}
    assert chip.call("flash_nrf51_erase", page) & 0xFF == 0
    assert chip.faults == []


def _check(executable: Path) -> None:
    """Hold chips against all of it."""
    for check in (_store_equals_the_model, _stays_in_its_region, _tells_failures):
        check(Nrf51Flash(executable))


def test_the_driver_does_nothing_that_the_manual_forbids(objects: list[Path], tmp_path: Path) -> None:
    _check(_link(tmp_path, objects))


def test_a_controller_that_does_not_become_ready_is_told(objects: list[Path], tmp_path: Path) -> None:
    """After a time, and nothing is done to it then."""
    chip = Nrf51Flash(_link(tmp_path, objects))
    chip.stuck = True
    assert chip.call("flash_nrf51_erase", KEPT) & 0xFF == 0  # it has begun
    assert chip.call("flash_nrf51_write", KEPT, chip.put(bytes(LINE))) & 0xFF == 0
    assert chip.faults == []


@pytest.mark.parametrize("fault", long([*FAULTS][::2], FAULTS))
def test_the_stricter_model_finds_a_fault_of_the_driver(fault: str, objects: list[Path], tmp_path: Path) -> None:
    executable = _link(tmp_path, objects, FAULTS[fault])
    with pytest.raises(AssertionError):
        _check(executable)

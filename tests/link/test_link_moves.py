"""MOVE: the client against the model of a device, and the lines of the model while its scan is moved at random."""

import struct

import pytest
from client_line import VirtualLine
from client_rig import KEY, Watched, client, model
from line_log import PlayedLine, WrongLine
from link_programs import INFO, make_scan
from moved_scans import BOOT as OTHER_BOOT
from moved_scans import SLOW_SCAN, MovedScan, moved
from replacing import replace
from sets import LONG_TEST
from test_line_log import Log

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FACTOR_FRACTION_BITS, FrameProgram
from tablegen.link.errors import LinkLost, Refused, Unsuitable
from tablegen.link.frames import FrameReader
from tablegen.link.messages import SPLINE_DEGREE, AxisWords, DeviceState, Feature, More, Reason, Request, Upload
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import SequencerPlayer
from tablegen.link.program_image import make_image

MOVES = replace(INFO, features=INFO.features | Feature.COMMIT_MODES, more=More.MOVE)
SLOW_MOVES = replace(
    MOVES,
    more=More.MOVE | More.SLOW_PARTS | More.SLOW_MOVE,
    slow_knots=65,
    slow_index_bits=7,
    degree=SPLINE_DEGREE,
    image_bytes=4000,
)
SCAN = make_scan(3)
IMAGES = [SCAN.image(False), SCAN.image(True)]


def _words(share: float = 0.9, codes: int = 300) -> tuple[AxisWords, AxisWords]:
    """Words of a smaller scan beside the one of ``SCAN``."""
    x, y = (
        AxisWords(round(share * output.gain_word), output.offset_word + (codes << output.gain_q))
        for output in (SCAN.program.x.output, SCAN.program.y.output)
    )
    return x, y


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("image", IMAGES, ids=["tables", "fourier"])
def test_a_moved_program_goes_on_with_its_frame(image: object, key: bytes) -> None:
    line = Watched(model(MOVES, key))
    with client(line, key=key or None) as device:
        generation = device.upload(image).generation  # type: ignore[arg-type]
        device.arm()
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 5.0)
        result = device.move(*_words(), generation)
        status = device.status()
        assert (result.generation, status.generation, status.moved, status.hash) == (3, 3, True, bytes(32))
        assert 0 <= result.line < 6
        expected = make_image(moved(SCAN.program, *_words()), bytes(32).hex())
        assert device.readback() == expected.data
        assert line.device.player.playing.x.output == moved(SCAN.program, *_words()).x.output  # type: ignore[union-attr]
        again = device.upload(image, swap=CommitMode.KEEP)  # type: ignore[arg-type]
        status = device.status()
        assert (again.already_running, again.generation, status.moved) == (False, 4, False)
        assert status.hash.hex() == SCAN.digest
    (move,) = [frame for frame in line.frames if frame.type == Request.MOVE]
    assert len(move.payload) == 28 + (16 if key else 0)


def test_what_cannot_be_moved() -> None:
    line = Watched(model(MOVES))
    with client(line) as device:
        with pytest.raises(Refused, match=r"refused MOVE \(readback\)"):
            device.move(*_words(), 1)  # the program of the firmware
        device.upload(IMAGES[0])
        with pytest.raises(Refused, match=r"\(generation\)") as caught:
            device.move(*_words(), 1)
        assert caught.value.detail == 2
        with pytest.raises(Refused, match=r"\(range\)"):
            device.move(*_words(1.0, 30_000), 2)
        line.device.permits = False
        with pytest.raises(Refused, match=r"\(interlock\)"):
            device.move(*_words(), 2)
        status = device.status()
        assert (status.generation, status.moved, status.hash.hex()) == (2, False, SCAN.digest)


def test_nothing_is_sent_to_a_device_that_takes_no_moves() -> None:
    line = Watched(model())
    with client(line) as device, pytest.raises(Unsuitable, match="DAC_MOVE=1"):
        device.move(*_words(), 1)
    assert line.count(Request.MOVE) == 0


def test_an_upload_stays_where_it_is_while_the_scan_is_moved() -> None:
    device, image = model(MOVES), make_scan(5).image(False)
    with client(VirtualLine(device)) as host:
        host.upload(IMAGES[0])
        session = host._session
        until = session.now() + 5.0
        session.ask(Request.BEGIN, image.info.pack(), 4, until)
        session.ask(Request.DATA, struct.pack("<I", 0) + image.data[:200], 4, until)
        host.move(*_words(), 2)
        status = host.status()
        assert (status.upload, status.received) == (Upload.RECEIVING, 200)
        result = host.upload(image)
        assert (result.generation, result.resumed) == (4, 200)
        assert host.readback() == image.data


def test_a_move_is_not_sent_again_to_a_device_that_has_restarted() -> None:
    line = Watched(model(MOVES))
    with client(line) as device:
        device.upload(IMAGES[0])
        line.device.reboot()
        with pytest.raises(LinkLost):
            device.move(*_words(), 1)
    assert line.count(Request.MOVE) == 1


def test_a_lost_answer_does_not_move_twice() -> None:
    line = Watched(model(MOVES))
    with client(line) as device:
        device.upload(IMAGES[0])
        lost: list[bytes] = []

        def lose(piece: bytes) -> list[bytes]:
            if not lost and any(frame.type == Request.MOVE | 0x80 for frame in FrameReader().feed(piece)):
                lost.append(piece)
                return []
            return [piece]

        line.spoil_back = lose
        assert device.move(*_words(), 2).generation == 3
        assert lost
        assert line.device.player.swaps == 3


def test_an_image_that_was_moved_is_not_committed_again() -> None:
    with client(VirtualLine(model(MOVES))) as device:
        device.upload(IMAGES[0])
        device.move(*_words(), 2)
        with pytest.raises(Refused) as caught:
            device._session.act(Request.COMMIT, struct.pack("<I", IMAGES[0].info.image_crc), 8, 1e9)
    assert caught.value.reason == Reason.UPLOAD


class _Moving:
    """A model whose lines are noted as firmware notes them."""

    def __init__(self, slow: bool = False) -> None:
        self._log = Log()
        info = SLOW_MOVES if slow else MOVES
        self._device = ModelDevice(info, SequencerPlayer(OTHER_BOOT.program, on_tick=self._log))
        self.receive, self.transmit, self.tick = self._device.receive, self._device.transmit, self._device.tick

    def lines(self) -> list[tuple[int, ...]]:
        """Those that ended since the last call."""
        lines, self._log.lines = self._log.lines, []
        return [(one.generation, one.line, one.ticks, one.crc, one.markers, one.faults) for one in lines]


@pytest.mark.parametrize("change", [{"crc": 1}, {"line": 4}, {"generation": 1}, {"ticks": 3}])
def test_a_line_that_cannot_be_is_noticed(change: dict[str, int]) -> None:
    """The control of the check below: of a good log one field of one line is changed."""
    lines = []

    class Noted(_Moving):
        def lines(self) -> list[tuple[int, ...]]:
            lines.extend(super().lines())
            return []

    scan = MovedScan(Noted(), 2)
    scan.play(30)
    log = [PlayedLine(*line) for line in lines]
    scan.check.follow(log[:5])
    ((name, by),) = change.items()
    with pytest.raises((WrongLine, KeyError)):
        scan.check.follow([replace(log[5], **{name: getattr(log[5], name) ^ by})])


@pytest.mark.parametrize("slow", [False, True], ids=["straight", "slow parts"])
@pytest.mark.parametrize(
    "moves", [60, pytest.param(3000, marks=pytest.mark.rest), pytest.param(100_000, marks=LONG_TEST)]
)
def test_no_random_move_leaves_a_limit_or_restarts_a_frame(moves: int, slow: bool) -> None:
    scan = MovedScan(_Moving(slow), 2, slow)
    scan.play(moves)
    assert scan.seen["MOVED"] > moves // 4
    assert scan.check.generation == 2 + scan.seen["MOVED"]
    assert (scan.seen["WORD"] > 0) == slow


# Slow parts


def _slow_words(program: ScanProgram, share: float = 0.9, codes: int = 300) -> tuple[AxisWords, AxisWords]:
    """Words of a smaller scan with slow parts, beside where it was uploaded."""
    x, y = (
        AxisWords(
            round(share * axis.slow.gain_word),
            axis.slow.offset_word + (codes << axis.output.gain_q),
            round(share * (1 << FACTOR_FRACTION_BITS)),
        )
        for axis in (program.x, program.y)
        if isinstance(axis, FrameProgram)
    )
    return x, y


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
def test_a_program_with_slow_parts_is_moved(key: bytes) -> None:
    """Gains are those of the upload times the factor, after another move too."""
    line, image = Watched(model(SLOW_MOVES, key)), make_image(SLOW_SCAN, 64 * "5")
    with client(line, key=key or None) as device:
        device.upload(image)
        device.arm()
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 5.0)
        for generation, share in enumerate((0.5, 0.9), 2):
            words = _slow_words(SLOW_SCAN, share)
            assert device.move(*words, generation).generation == generation + 1
            moved_scan = moved(SLOW_SCAN, *words)
            playing = line.device.player.playing
            assert playing is not None
            for name in ("x", "y"):
                before, now = getattr(SLOW_SCAN, name), getattr(playing, name)
                assert now.gains.words == pytest.approx(share * before.gains.words, abs=2.0)
                assert now.slow.gain_word == pytest.approx(share * before.slow.gain_word, abs=0.5)
            assert device.readback() == make_image(moved_scan, bytes(32).hex()).data
        assert device.status().moved
        back = AxisWords(SLOW_SCAN.x.slow.gain_word, SLOW_SCAN.x.slow.offset_word, 1 << FACTOR_FRACTION_BITS)
        device.move(back, replace(_slow_words(SLOW_SCAN, 1.0, 0)[1]), 4)
        assert device.readback() == image.data
    sizes = {len(frame.payload) for frame in line.frames if frame.type == Request.MOVE}
    assert sizes == {36 + (16 if key else 0)}


def test_which_moves_a_program_takes() -> None:
    """Factors belong to a program with slow parts, and a gain has 18 bits."""
    with client(Watched(model(SLOW_MOVES))) as device:
        device.upload(make_image(SLOW_SCAN, 64 * "5"))
        with pytest.raises(Refused, match=r"\(slow_part\)"):
            device.move(*_words(), 2)
        x, y = _slow_words(SLOW_SCAN)
        with pytest.raises(Refused, match=r"\(word\)") as caught:
            device.move(x, replace(y, factor_word=1 << 22), 2)
        gains = SLOW_SCAN.y.gains.words.tolist()
        knot = next(at for at, gain in enumerate(gains) if not -(1 << 17) <= gain << 6 < 1 << 17)
        slow = SLOW_SCAN.y
        assert caught.value.detail == 1 + 2 * (2 * len(slow.fast.words) + len(slow.slow.words) + knot)
        device.upload(IMAGES[0])
        with pytest.raises(Refused, match=r"\(slow_part\)"):
            device.move(x, y, 3)
        assert device.status().generation == 3
    line = Watched(model(replace(SLOW_MOVES, more=SLOW_MOVES.more & ~More.SLOW_MOVE)))
    with client(line) as device:
        device.upload(make_image(SLOW_SCAN, 64 * "5"))
        with pytest.raises(Unsuitable, match="moved_gains"):
            device.move(x, y, 2)
        with pytest.raises(Refused, match=r"\(slow_part\)"):
            device.move(*_words(), 2)
    assert line.count(Request.MOVE) == 1

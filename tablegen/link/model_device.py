"""A model of a device in Python: bytes in, bytes out, as docs/protocol.md has it."""

import hashlib
import hmac
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import can_keep
from tablegen.link import messages
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import (
    ANSWER,
    MOVED,
    NONCE_BYTES,
    PERMITS,
    TAG_BYTES,
    AxisLimits,
    DeviceInfo,
    DeviceState,
    DeviceStatus,
    Feature,
    ImageInfo,
    Listing,
    More,
    Move,
    Play,
    Reason,
    Refusal,
    Request,
    Upload,
    ZImageInfo,
    ZStatus,
)
from tablegen.link.model_bank import ActiveUpload, Bank, IncomingUpload, RequestRefused, plain_move_bytes
from tablegen.link.model_store import ModelStore
from tablegen.link.players import Player
from tablegen.link.program_image import ProgramImage
from tablegen.link.store import Flash, Layout, Store

_TAGGED = {Request.COMMIT, Request.PARK, Request.ARM, Request.TRIGGER, Request.CLEAR, Request.LIMITS}
_TAGGED |= {Request.SAVE, Request.SELECT, Request.CONFIRM, Request.DELETE, Request.MOVE, Request.PLAY}
_ACTING = _TAGGED | {Request.ABORT}
_PAYLOAD_BYTES: dict[int, int] = {  # bytes of a payload without its tag
    Request.BEGIN: ImageInfo.LAYOUT.size,
    Request.COMMIT: 4,
    Request.ARM: 4,
    Request.LIMITS: 2 * AxisLimits.LAYOUT.size,
    Request.SLOT: 1,
    Request.SAVE: 5,
    Request.SELECT: 2,
    Request.DELETE: 1,
    Request.MOVE: Move.LAYOUT.size,
    Request.LIST: 2,
    Request.PLAY: Play.LAYOUT.size,
}
_COMMIT_WITH_MODE = 5  # bytes
_LONGEST_NAME = 200  # bytes of a name in an answer to LIST
_NUMBERS = 0xFFFF  # at most, over the link
_MAX_FRAMES = 1 << 31
CHALLENGE_MS = 10_000  # how long a nonce may be used
IDENTITY_BYTES = range(4, 33)


@dataclass
class _LastRequest:
    """The last request that acts; ``answer`` is None while it is in progress."""

    seq: int
    type: int
    answer: bytes | None = None


@dataclass
class _PendingRequest:
    """A COMMIT, MOVE, PLAY or ABORT without an answer yet; without a request a program that the application plays."""

    request: Frame | None
    memory: _LastRequest | None
    before: _LastRequest | None = None
    nonce: bytes | None = None
    ticks: int = 0
    swaps: int = 0


def tag(key: bytes, nonce: bytes, request: Frame, image: bytes | None = None) -> bytes:
    """Compute the 16 bytes that end the payload of ``request``, given without them; ``image`` is that of a COMMIT."""
    header = struct.pack("<BBI", request.type, request.seq, request.session)
    digest = b"" if image is None else hashlib.blake2s(image).digest()
    message = nonce + header + request.payload + digest
    return hashlib.blake2s(message, key=key, digest_size=TAG_BYTES).digest()


class ModelDevice:
    """A model of a device in front of ``player``; ``boot_hash`` is that of the program with which it starts.

    ``key``: 16 to 32 bytes, with the feature KEY; nonces then come from ``identity``, of 4 to 32 bytes, ``boot`` and a
    counter, or from ``nonces``, and may be used for ``CHALLENGE_MS`` of the clock ``milliseconds``. ``reboot`` counts
    ``boot`` on, as a device does that keeps its count without power. ``staged``: the image is kept, as in Verilog, and
    not its tables. ``checking``: ticks that the checks take.
    ``flash`` with its layout, for the feature STORE, keeps programs, ``stores_while_playing`` even while a scan plays;
    ``compiled`` are images of the programs that come with the firmware, by their names; over the link they are played
    with ``More.PLAY``.
    ``most_frames`` limits ARM. ``permits`` is the interlock, ``memory`` the image being uploaded, which COMMIT checks.
    ``z_player`` is the second sequencer, whose x is z, of a device that has one; ``plays_z`` says that the program with
    which it starts has z.
    """

    def __init__(
        self,
        info: DeviceInfo,
        player: Player,
        *,
        key: bytes = b"",
        boot: int = 0,
        boot_hash: bytes = bytes(messages.HASH_BYTES),
        identity: bytes = b"a model",
        nonces: Callable[[], bytes] | None = None,
        milliseconds: Callable[[], int] = lambda: 0,
        staged: bool = False,
        checking: int = 0,
        most_frames: int = _MAX_FRAMES,
        flash: tuple[Flash, Layout] | None = None,
        stores_while_playing: bool = False,
        compiled: Mapping[str, ProgramImage] | None = None,
        z_player: Player | None = None,
        plays_z: bool = False,
    ) -> None:
        if bool(key) != (Feature.KEY in info.features):
            raise ValueError("a key and the feature go together")
        if (flash is not None) != (Feature.STORE in info.features):
            raise ValueError("a flash and the feature go together")
        _check_moves(info, staged)
        if More.PLAY in info.more and (staged or (not compiled and flash is None)):
            raise ValueError("a device that takes PLAY keeps tables and has programs")
        _check_z(info, z_player, staged)
        self.info, self.player, self.boot = info, player, boot
        self.z_player, self._starts_z = z_player, plays_z
        self.permits = True
        if key and len(identity) not in IDENTITY_BYTES:
            raise ValueError(f"an identity of {len(identity)} bytes; a key needs one of 4 to 32")
        self._key, self._identity, self._boot_hash = key, identity, boot_hash
        self._milliseconds = milliseconds
        second = None if z_player is None else Bank(info.of_z, z_player, staged)
        self._bank = Bank(info, player, staged, second)
        self._nonces = nonces or self._counted_nonce
        self._checking, self._most_frames = checking, most_frames
        self._requests: dict[int, Callable[[Frame], bytes | None]] = {
            Request.HELLO: self._hello,
            Request.BEGIN: lambda frame: self._bank.begin(frame.payload),
            Request.DATA: lambda frame: self._bank.data(frame.payload),
            Request.COMMIT: self._commit,
            Request.ABORT: self._abort,
            Request.STATUS: lambda frame: self.status().pack(),
            Request.READBACK: self._readback,
            Request.PARK: lambda frame: self._pass_on(lambda player: player.park()),
            Request.ARM: self._arm,
            Request.TRIGGER: lambda frame: self._pass_on(lambda player: player.trigger(), self.plays_z),
            Request.CLEAR: lambda frame: self._pass_on(lambda player: player.clear()),
            Request.CHALLENGE: self._challenge,
            Request.LIMITS: lambda frame: self._bank.limit(frame.payload),
        }
        if not key:
            del self._requests[Request.CHALLENGE]
        if Feature.READBACK not in info.features:
            del self._requests[Request.READBACK]
        if flash is not None:
            self._requests |= {
                Request.SLOT: lambda frame: self._store.slot(frame.payload),
                Request.SAVE: lambda frame: self._store.save(frame.payload),
                Request.SELECT: lambda frame: self._store.select(frame.payload),
                Request.CONFIRM: lambda frame: self._store.confirm(),
                Request.DELETE: lambda frame: self._store.delete(frame.payload),
            }
        if More.MOVE in info.more:
            self._requests[Request.MOVE] = self._move
        if More.PLAY in info.more:
            self._requests[Request.LIST] = self._list
            self._requests[Request.PLAY] = self._play
        self._flash, self._stores_while_playing = flash, stores_while_playing
        self._compiled = dict(compiled or {})
        self._store: ModelStore
        self._power_up()
        if flash is not None:
            self.player.restart(self._kept_program())

    def _power_up(self) -> None:
        self._reader = FrameReader()
        self._out = bytearray()
        self._session: int | None = None
        self._last: _LastRequest | None = None
        self._nonce: bytes | None = None
        self._challenged_at = 0
        self._pending: _PendingRequest | None = None
        self._aborts: list[_PendingRequest] = []
        self._challenges = 0
        self._before: _LastRequest | None = None  # the request before a COMMIT that is being checked
        self.plays_z = self._played_z = self._starts_z  # the program that plays or is committed; the one before

    def reboot(self) -> None:
        """Start again, with nothing but what is in the firmware, and the next boot count."""
        self.boot = (self.boot + 1) & 0xFFFFFFFF
        self._bank.power_up()
        self._power_up()
        self.player.restart(self._kept_program())
        if self.z_player is not None:
            self.z_player.restart()

    def _kept_program(self) -> ScanProgram | None:
        """Return the kept program that a start begins with; None for that of the firmware."""
        if self._flash is None:
            return None
        self._store = ModelStore(Store(*self._flash), self._bank, self.player, self._stores_while_playing)
        return self._store.load()

    def keeps(self, slot: int) -> bool:
        """Return True if a slot has a program."""
        return self._store.image(slot) is not None

    def play(self, number: int) -> bool:
        """Play a program of the device as if a host uploaded it: compiled ones have the first numbers, then slots.

        Returns
        -------
        bool
            False if no program has this number, or it does not suit the device, or not now.
        """
        image = self._program(number) if self.permits else None
        incoming = None if image is None else self._bank.put(image)
        if incoming is None:
            return False
        self._pending = _PendingRequest(None, None, ticks=self._checking)
        if self._checking == 0:
            self._check(self._pending, incoming)
        return True

    def _program(self, number: int) -> ProgramImage | None:
        """Return the image of a compiled or kept program."""
        slot = number - len(self._compiled)
        if slot < 0:
            return list(self._compiled.values())[number]
        return None if self._flash is None else self._store.image(slot)

    def _numbers(self) -> int:
        """Return how many compiled programs and slots there are."""
        return len(self._compiled) + (0 if self._flash is None else self._flash[1].slots)

    @property
    def memory(self) -> bytearray:
        """The image of the upload in progress, from the memory; empty without one."""
        return bytearray() if self._bank.incoming is None else self._bank.incoming.data

    def receive(self, data: bytes) -> None:
        """Receive bytes from the host."""
        for frame in self._reader.feed(data):
            if not frame.type & ANSWER:
                self._judge(frame)

    def transmit(self) -> bytes:
        """Return the bytes for the host since the last call."""
        sent = bytes(self._out)
        self._out.clear()
        return sent

    def tick(self, ticks: int = 1) -> None:
        """Play so many ticks, and answer what waited for them."""
        commit, incoming = self._pending, self._bank.at_work()
        if commit is not None and incoming is not None and incoming.state is Upload.CHECKING:
            first = min(ticks, commit.ticks)
            self._advance(first)
            commit.ticks -= first
            ticks -= first
            if commit.ticks == 0:
                self._check(commit, incoming)
        self._advance(ticks)
        self._settle()

    def _advance(self, ticks: int) -> None:
        for player in self._players():
            player.advance(ticks)

    def _players(self, with_z: bool = True) -> list[Player]:
        """Return the sequencers: that of x and y, then that of z where there is one."""
        return [self.player] if self.z_player is None or not with_z else [self.player, self.z_player]

    def status(self) -> DeviceStatus:
        """Return the answer to STATUS."""
        player, active, move = self.player, self._bank.active, self._bank.move
        incoming = None if move is not None else self._bank.incoming
        known = self._boot_hash if active is None else active.info.hash
        upload = move or incoming
        return DeviceStatus(
            state=player.state,
            upload=Upload.NONE if upload is None else upload.state,
            faults=player.faults,
            flags=(PERMITS if self.permits else 0) | (MOVED if active is not None and active.moved is not None else 0),
            boot=self.boot,
            generation=player.swaps,
            line=player.line,
            received=0 if incoming is None else len(incoming.data),
            image_crc=0 if incoming is None else incoming.info.image_crc,
            fault_counts=player.fault_counts,
            bad_frames=self._reader.bad_frames,
            hash=bytes(messages.HASH_BYTES) if player.state is DeviceState.NO_PROGRAM else known,
            z=None if self.z_player is None else self._status_of_z(self.z_player),
        )

    def _status_of_z(self, player: Player) -> ZStatus:
        return ZStatus(player.state, player.faults, self.plays_z, player.swaps, player.line, player.fault_counts)

    # Checks that every request passes

    def _judge(self, frame: Frame) -> None:
        memory: _LastRequest | None = None
        try:
            if frame.type != Request.HELLO and frame.session != self._session:
                raise RequestRefused(Reason.SESSION)
            if frame.type not in self._requests:
                raise RequestRefused(Reason.TYPE)
            self._check_payload(frame)
            if _acts(frame):
                if self._is_repeated(frame):
                    return
                if frame.type in _TAGGED and frame.type != Request.COMMIT:
                    self._check_tag(frame, self._use_nonce())
                memory = _LastRequest(frame.seq, frame.type)
                self._before, self._last = self._last, memory
            answer = self._requests[frame.type](frame)
            if answer is not None:
                self._answer(frame, answer, memory)
        except RequestRefused as refused:
            self._refuse(frame, refused, memory)

    def _is_repeated(self, frame: Frame) -> bool:
        """Return True if a request repeats the last one, whose answer is sent again.

        Raises
        ------
        RequestRefused
            If a later request has replaced it.
        """
        if self._last is None:
            return False
        behind = (self._last.seq - frame.seq) & 0xFF
        if behind == 0 and frame.type == self._last.type:
            self._out += self._last.answer or b""
            return True
        if behind < 128:
            raise RequestRefused(Reason.OLD)
        return False

    def _check_payload(self, frame: Frame) -> None:
        payload, size = frame.payload, len(frame.payload)
        kind = Request(frame.type)
        if kind == Request.HELLO:
            if payload and payload[0] != messages.VERSION:
                raise RequestRefused(Reason.VERSION, messages.VERSION)
            good = size == 1
        elif kind == Request.DATA:
            good = 5 <= size <= 4 + self.info.data_bytes
        elif kind == Request.READBACK:
            good = size == 5 and 1 <= payload[4] <= messages.DATA_BYTES
        else:
            good = size in self._sizes(kind)
        if good and kind == Request.ARM:
            good = int(struct.unpack_from("<I", payload)[0]) <= self._most_frames
        elif good and kind == Request.COMMIT and _plain_bytes(frame) == _COMMIT_WITH_MODE:
            good = payload[4] in list(CommitMode)
        elif good and kind == Request.PLAY:
            modes = list(CommitMode) if Feature.COMMIT_MODES in self.info.features else [CommitMode.LINE]
            good = Play.unpack(payload).mode in modes
        elif good and kind == Request.SELECT:
            good = payload[1] <= 1
        if not good:
            raise RequestRefused(Reason.PAYLOAD)

    def _sizes(self, kind: Request) -> set[int]:
        """Return the sizes that the payload of a request may have."""
        plain = _PAYLOAD_BYTES.get(kind, 0)
        sizes = {plain, plain + TAG_BYTES} if self._key and kind in _TAGGED else {plain}
        if kind == Request.COMMIT and Feature.COMMIT_MODES in self.info.features:
            return sizes | {size + 1 for size in sizes}
        if kind == Request.MOVE and More.SLOW_MOVE in self.info.more:
            return sizes | {size + Move.FACTORS.size for size in sizes}
        if kind == Request.BEGIN and self.info.z is not None:
            return sizes | {plain + ZImageInfo.LAYOUT.size}
        if kind == Request.LIMITS:
            return sizes | {0} if Feature.NARROWS in self.info.features else {0}
        return sizes

    def _use_nonce(self) -> bytes | None:
        nonce, self._nonce = self._nonce, None
        return nonce if self._milliseconds() - self._challenged_at < CHALLENGE_MS else None

    def _check_tag(self, frame: Frame | None, nonce: bytes | None, image: bytes | None = None) -> None:
        if not self._key or frame is None:
            return
        plain = _plain_bytes(frame)
        received_tag = frame.payload[plain:]
        bare = Frame(frame.type, frame.seq, frame.session, frame.payload[:plain])
        if nonce is None or not hmac.compare_digest(tag(self._key, nonce, bare, image), received_tag):
            raise RequestRefused(Reason.KEY)

    def _answer(self, frame: Frame | None, payload: bytes, memory: _LastRequest | None) -> None:
        if frame is None:
            return
        self._send(Frame(frame.type | ANSWER, frame.seq, frame.session, payload), memory)

    def _refuse(self, frame: Frame | None, refused: RequestRefused, memory: _LastRequest | None) -> None:
        if frame is None:
            return
        payload = Refusal(frame.type, refused.reason, refused.detail).pack()
        self._send(Frame(messages.REFUSAL, frame.seq, frame.session, payload), memory)

    def _send(self, answer: Frame, memory: _LastRequest | None) -> None:
        wire = answer.encode()
        if memory is not None:
            memory.answer = wire
        self._out += wire

    # Requests

    def _hello(self, frame: Frame) -> bytes:
        if frame.session != self._session:
            self._session, self._last = frame.session, None
        return self.info.hello(self.status())

    def _commit(self, frame: Frame) -> bytes | None:
        upload = self._bank.find(*struct.unpack_from("<I", frame.payload))
        if isinstance(upload, ActiveUpload):
            return struct.pack("<II", upload.generation, upload.line)
        if not self.permits:
            raise RequestRefused(Reason.INTERLOCK)
        assert self._last is not None
        upload.state = Upload.CHECKING
        self._pending = _PendingRequest(frame, self._last, self._before, self._use_nonce(), self._checking)
        if self._checking == 0:
            self._check(self._pending, upload)
        return None

    def _move(self, frame: Frame) -> None:
        """Begin the checks of the program that plays, with other gain and offset words."""
        move = self._bank.begin_move(frame.payload, self.permits)
        assert self._last is not None
        self._pending = _PendingRequest(frame, self._last, self._before, ticks=self._checking)
        if self._checking == 0:
            self._check(self._pending, move)

    def _list(self, frame: Frame) -> bytes:
        """Return what a number has."""
        (number,) = struct.unpack("<H", frame.payload)
        if number >= self._numbers():
            raise RequestRefused(Reason.NUMBER, self._numbers())
        image, names = self._program(number), list(self._compiled)
        name = names[number].encode()[:_LONGEST_NAME] if number < len(names) else b""
        digest = bytes(messages.HASH_BYTES) if image is None else image.info.hash
        numbers, compiled = min(self._numbers(), _NUMBERS), min(len(names), _NUMBERS)
        return Listing(numbers, compiled, int(image is not None), digest, name).pack()

    def _play(self, frame: Frame) -> None:
        """Begin the checks of a program of the device."""
        self._bank.check_idle()
        image = self._program(Play.unpack(frame.payload).number)
        if image is None:
            raise RequestRefused(Reason.NUMBER, self._numbers())
        if not self.permits:
            raise RequestRefused(Reason.INTERLOCK)
        incoming = self._bank.replace(image)
        assert self._last is not None
        self._pending = _PendingRequest(frame, self._last, self._before, ticks=self._checking)
        if self._checking == 0:
            self._check(self._pending, incoming)

    def _check(self, commit: _PendingRequest, incoming: IncomingUpload) -> None:
        """Check an image, and bring it into the idle bank."""
        request = commit.request
        is_upload = request is not None and request.type == Request.COMMIT
        try:
            tagged = request if is_upload else None
            programs = self._bank.accept(incoming, lambda image: self._check_tag(tagged, commit.nonce, image))
            if not self.permits:
                raise RequestRefused(Reason.INTERLOCK)
            self._hand_over(*programs, _mode_of(request))
        except RequestRefused as refused:
            self._pending = None
            stays = refused.reason in (Reason.INTERLOCK, Reason.KEY, Reason.TICKS, Reason.KEEP, Reason.PLAYING)
            if incoming is self._bank.move:
                self._bank.move = None
            elif stays and is_upload:
                incoming.state = Upload.RECEIVING
            else:
                self._bank.incoming = None
            is_used = refused.reason != Reason.KEY
            if not is_used and self._last is commit.memory:
                self._last = commit.before
            self._refuse(request, refused, commit.memory if is_used else None)
            return
        incoming.state = Upload.WAITING
        commit.swaps = self.player.swaps

    def _hand_over(self, program: ScanProgram, of_z: ScanProgram | None, mode: CommitMode) -> None:
        """Commit the programs of both sequencers, or none.

        Raises
        ------
        RequestRefused
            If z would begin or end to play in a scan, a frame cannot go on, or a queue has no room.
        """
        begins_or_ends = (of_z is not None) != self.plays_z
        if begins_or_ends and any(player.state is DeviceState.PLAYING or player.starts for player in self._players()):
            raise RequestRefused(Reason.PLAYING)
        commits = [(self.player, program)]
        if of_z is not None and self.z_player is not None:
            commits.append((self.z_player, of_z))
        if mode is CommitMode.KEEP and not all(self._can_keep(*each) for each in commits):
            raise RequestRefused(Reason.KEEP)
        if not all(player.has_room(1 + begins_or_ends) for player in self._players()):
            raise RequestRefused(Reason.TICKS)
        if begins_or_ends:  # an ARM that only one of them had is forgotten
            for player in self._players():
                player.park()
        for player, each in commits:
            player.commit(each, mode)
        self._played_z, self.plays_z = self.plays_z, of_z is not None

    def _can_keep(self, player: Player, program: ScanProgram) -> bool:
        """Return False if a scan plays whose frame this program cannot continue."""
        playing = player.playing
        return self.player.state != DeviceState.PLAYING or playing is None or can_keep(playing, program)

    def _settle(self) -> None:
        """Answer a COMMIT or MOVE and its ABORTs once the sequencer has said what became of the program that waited."""
        commit, incoming, player = self._pending, self._bank.at_work(), self.player
        if commit is None or incoming is None or incoming.state is not Upload.WAITING:
            return
        if player.swaps != commit.swaps:
            self._played_z = self.plays_z
            self._bank.take(incoming)
            self._answer(commit.request, struct.pack("<II", player.swaps, player.swapped_at), commit.memory)
        elif player.writable:
            self.plays_z = self._played_z
            self._bank.incoming = self._bank.move = None
            self._refuse(commit.request, RequestRefused(Reason.WITHDRAWN), commit.memory)
        else:
            return
        self._pending = None
        for abort in self._aborts:
            self._answer(abort.request, struct.pack("<I", player.swaps), abort.memory)
        self._aborts.clear()

    def _abort(self, frame: Frame) -> bytes | None:
        commit, incoming = self._pending, self._bank.at_work()
        assert self._last is not None
        if incoming is not None and incoming.state is Upload.WAITING:
            self._withdraw(commit)
            self._aborts.append(_PendingRequest(frame, self._last))
            return None
        self._pending = self._bank.incoming = self._bank.move = None
        if commit is not None:
            self._refuse(commit.request, RequestRefused(Reason.WITHDRAWN), commit.memory)
        return struct.pack("<I", self.player.swaps)

    def _readback(self, frame: Frame) -> bytes:
        offset, count = struct.unpack("<IB", frame.payload)
        return struct.pack("<I", offset) + self._bank.readback(offset, count)

    def _withdraw(self, commit: _PendingRequest | None) -> None:
        """Withdraw the programs that wait; where z would have begun or ended, a trigger behind the commit too."""
        parks = self.plays_z != self._played_z
        if not all(player.has_room(1 + parks) for player in self._players()):
            raise RequestRefused(Reason.TICKS)
        for player in self._players():
            player.withdraw()
            if parks and commit is not None and self.player.swaps == commit.swaps:
                player.park()

    def _arm(self, frame: Frame) -> bytes:
        (frames,) = struct.unpack_from("<I", frame.payload)
        return self._pass_on(lambda player: player.arm(frames))

    def _pass_on(self, request: Callable[[Player], bool], with_z: bool = True) -> bytes:
        """Give a request to the sequencers, between the same two ticks."""
        players = self._players(with_z)
        if not all(player.has_room(1) for player in players):
            raise RequestRefused(Reason.TICKS)
        for player in players:
            request(player)
        return b""

    def _challenge(self, frame: Frame) -> bytes:
        self._nonce = self._nonces()
        self._challenged_at = self._milliseconds()
        assert len(self._nonce) == NONCE_BYTES
        return self._nonce

    def _counted_nonce(self) -> bytes:
        self._challenges += 1
        count = bytes([len(self._identity)]) + self._identity + struct.pack("<II", self.boot, self._challenges)
        return hashlib.blake2s(count, key=self._key, digest_size=NONCE_BYTES).digest()


def _check_moves(info: DeviceInfo, staged: bool) -> None:
    """Raise ``ValueError`` if a device cannot take moves as it says."""
    if More.MOVE in info.more and (staged or Feature.COMMIT_MODES not in info.features):
        raise ValueError("a device that takes MOVE keeps tables and has modes of a COMMIT")
    if More.SLOW_MOVE in info.more and More.MOVE | More.SLOW_PARTS not in info.more:
        raise ValueError("a device that moves slow parts takes MOVE and plays slow parts")


def _check_z(info: DeviceInfo, player: Player | None, staged: bool) -> None:
    """Raise ``ValueError`` if a device cannot have the output z, or not as it says."""
    if len({info.z is None, player is None, More.Z not in info.more}) != 1:
        raise ValueError("the output z, its feature and its player go together")
    if info.z is not None and (staged or Feature.STORE in info.features or info.more & (More.MOVE | More.PLAY)):
        raise ValueError("a device with z keeps tables, takes no moves, and has no programs by number or in slots")


def _plain_bytes(frame: Frame) -> int:
    """Return the bytes of a payload without its tag."""
    if frame.type == Request.COMMIT and len(frame.payload) in (_COMMIT_WITH_MODE, _COMMIT_WITH_MODE + TAG_BYTES):
        return _COMMIT_WITH_MODE
    if frame.type == Request.MOVE:
        return plain_move_bytes(len(frame.payload))
    return _PAYLOAD_BYTES.get(frame.type, 0)


def _mode_of(frame: Frame | None) -> CommitMode:
    """Return the mode of a COMMIT, a MOVE or a PLAY; without a request that of a program of the device."""
    if frame is None:
        return CommitMode.LINE
    if frame.type == Request.MOVE:
        return CommitMode.KEEP
    if frame.type == Request.PLAY:
        return CommitMode(Play.unpack(frame.payload).mode)
    return CommitMode(frame.payload[4]) if _plain_bytes(frame) == _COMMIT_WITH_MODE else CommitMode.LINE


def _acts(frame: Frame) -> bool:
    return frame.type in _ACTING and (frame.type != Request.LIMITS or frame.payload != b"")

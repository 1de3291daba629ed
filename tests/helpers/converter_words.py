"""The words at two converters against the integer model, where only they tell when a request was heard.

``follow_words`` holds every word. It knows the requests and their order, and tries all ticks on which each of them may
have been heard; tries that the next word refutes are dropped, and those that come to the same state are one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy

from following import Differs

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer

Request = Callable[[Sequencer], None]
Trial = tuple[Sequencer, list[int]]  # a model, and the ticks on which it heard requests


def commit(program: DualProgram) -> Request:
    """A program is committed."""
    return lambda model: model.commit(program)


def start(frames: int = 0) -> Request:
    """ARM, and a TRIGGER that finds it armed."""

    def request(model: Sequencer) -> None:
        model.arm(frames)
        model.trigger()

    return request


def park(model: Sequencer) -> None:
    """PARK."""
    model.park()


def _state(model: Sequencer, heard: int) -> tuple[object, ...]:
    programs = id(model.playing), id(model.idle)
    place = model.running, model.tick, model.line, model.frames_left, model.armed
    return heard, model.codes, *programs, *place


def follow_words(
    words: Iterable[tuple[int, ...]],
    requests: Sequence[Request],
    power_up: int = 0,
    *,
    codes: bool = False,
    pixels: bool = False,
    wrong: Mapping[int, Sequence[tuple[int, ...]]] | None = None,
) -> list[int]:
    """Hold words of x and y against a device that powers up at these codes, and hears the requests in this order.

    With ``codes`` they are the codes at the outputs, not the words. With ``pixels`` the third of each tick is whether
    it began a pixel. ``wrong`` has, by tick, other words than were played: negative controls, of which none may fit.
    Returns the tick on which each request was heard, the first one where several fit. Raises ``Differs`` at the first
    word that the model cannot have, and if not all requests were heard.
    """
    tries: list[Trial] = [(Sequencer(None, codes=(power_up, power_up)), [])]
    controls = dict(wrong or {})
    at = 0
    for at, word in enumerate(words):
        fitting: dict[tuple[int, ...], dict[tuple[object, ...], Trial]] = {}  # by what the models put out
        for before, heard in tries:
            model = before
            for number in range(len(heard), len(requests) + 1):
                trial = copy(model)
                put_out = _tick(trial, codes)[: 3 if pixels else 2]
                ticks = [*heard, *[at] * (number - len(heard))]
                fitting.setdefault(put_out, {}).setdefault(_state(trial, number), (trial, ticks))
                if number < len(requests):
                    model = copy(model)
                    requests[number](model)
        assert not fitting.keys() & set(controls.pop(at, ())), f"a wrong word of tick {at} is the model's"
        if word not in fitting:
            number = max(len(heard) for _, heard in tries)
            raise Differs(f"tick {at}: {word} after {number} of {len(requests)} requests is not the model's")
        tries = list(fitting[word].values())
    assert not controls, "the words end before the negative controls"
    for _, heard in tries:
        if len(heard) == len(requests):
            return heard
    raise Differs(f"not all of {len(requests)} requests were heard in {at + 1} ticks")


def _tick(model: Sequencer, codes: bool) -> tuple[int, int, int]:
    """What its next tick puts out, and whether it begins a pixel."""
    tick = model.step()
    if codes or model.playing is None:
        return tick.x, tick.y, tick.pixel
    return int(model.playing.x.output.word(tick.x)), int(model.playing.y.output.word(tick.y)), tick.pixel

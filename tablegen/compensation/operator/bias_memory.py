"""The memory of the bias: after a change of offset the sensitivity of a piezo follows late, and the image drifts."""

from msgspec import Struct

from tablegen.compensation.operator.creep import LogarithmicCreep

_APART = 0.02  # least relative difference of two time constants; nearer ones count as so far apart


class BiasMemory(Struct, frozen=True):
    """The shares of a change of offset that follow by exp(-t / time), beside creep: after a step up, and down.

    A share is of the change of the mean position; one below 0 is a piezo that goes too far at once, and comes back.
    Both directions differ, since the sensitivity is no linear function of the offset.
    """

    rise_share: float
    rise_time_s: float
    fall_share: float
    fall_time_s: float

    def late(self, step: float) -> tuple[float, float]:
        """Return share and time constant in s for a step of the offset; a share of 0 without a step."""
        if step > 0.0:
            return self.rise_share, self.rise_time_s
        return (self.fall_share if step < 0.0 else 0.0), self.fall_time_s


def late_terms(creep: LogarithmicCreep, time_s: float) -> list[tuple[float, float]]:
    """Return shares and time constants in s of what a motion by exp(-t / ``time_s``) lacks, with its own creep.

    A term of creep that follows the motion lacks a sum of both exponentials.
    """
    late, out = creep.direct, []
    for share, tau_s in creep.terms():
        apart = time_s - tau_s
        if abs(apart) < _APART * time_s:
            apart = _APART * time_s if apart >= 0.0 else -_APART * time_s
        late += share * (1.0 + tau_s / apart)
        out.append((-share * tau_s / apart, tau_s))
    return [(late, time_s), *out]

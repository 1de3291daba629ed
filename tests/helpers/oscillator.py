"""A driven oscillator, integrated step by step: physics without the formulas under test."""

import numpy as np


def runge_kutta_oscillator(
    frequency: float, quality: float, f: float, drive: complex
) -> tuple[list[float], list[float]]:
    """The target cos(2 pi f t) and the displacement x under Re(drive e^(i 2 pi f t)), after the transient.

    x'' + (w0 / Q) x' + w0^2 x = w0^2 u(t), fourth-order Runge-Kutta.
    """
    w0 = 2 * np.pi * frequency
    steps, periods = 400, 60
    h = 1 / f / steps

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        u = (drive * np.exp(2j * np.pi * f * t)).real
        return np.array([state[1], w0 * w0 * (u - state[0]) - w0 / quality * state[1]])

    state, t, target, reached = np.zeros(2), 0.0, [], []
    for i in range(steps * periods):
        k1 = rate(t, state)
        k2 = rate(t + h / 2, state + h / 2 * k1)
        k3 = rate(t + h / 2, state + h / 2 * k2)
        k4 = rate(t + h, state + h * k3)
        state, t = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
        if i >= steps * (periods - 1):
            target.append(float(np.cos(2 * np.pi * f * t)))
            reached.append(float(state[0]))
    return target, reached

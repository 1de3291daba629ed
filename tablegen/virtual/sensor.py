"""A displacement sensor: white noise and a slow drift on the true displacement."""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Floats


@dataclass(frozen=True)
class Sensor:
    """A sensor with ``noise_nm`` rms per reading and ``drift_nm_per_s``; the same seed gives the same readings."""

    noise_nm: float = 0.0
    drift_nm_per_s: float = 0.0
    seed: int = 0

    def read(self, displacement_nm: Floats, time_s: Floats) -> Floats:
        """Return readings of a displacement.

        Parameters
        ----------
        displacement_nm, time_s
            True displacement in nm and its times in s, shape (samples,) each.

        Returns
        -------
        Readings in nm, shape (samples,).
        """
        noise = np.random.default_rng(self.seed).standard_normal(displacement_nm.shape)
        return displacement_nm + self.drift_nm_per_s * time_s + self.noise_nm * noise

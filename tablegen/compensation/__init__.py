"""The paper's corrections: offset (1)-(4), scan size (6)-(12), hysteresis (13)-(22), frequency (23), dynamics."""

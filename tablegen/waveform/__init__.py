"""The line waveform as a Fourier series: closed-form coefficients, and three ways to limit its band."""

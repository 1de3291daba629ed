"""Hypothesis without deadlines: how long an example takes is the machine's affair. In CI its examples are fixed."""

from hypothesis import settings

settings.register_profile("tablegen", settings(), deadline=None)
settings.load_profile("tablegen")

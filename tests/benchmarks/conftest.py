"""The benchmarks are no package of the distribution: they find each other from their folder."""

import sys

from building import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "benchmarks"))

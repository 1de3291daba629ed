"""The first plan, certificate and files of a process: prints CPU seconds of each, and the most memory in MB.

Usage: python benchmarks/sections/plan_once.py SCAN
"""

import re
import sys
import time
from itertools import pairwise
from pathlib import Path

import tablegen
from tablegen.emit.render import render

setup = tablegen.load(sys.argv[1])
marks = [time.process_time()]
plan = tablegen.plan(setup)
marks.append(time.process_time())
certificates = tablegen.certify(plan)
marks.append(time.process_time())
render(plan, certificates)
marks.append(time.process_time())
# What the kernel says of this program alone: getrusage counts what the process had been before it.
memory = int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text("ascii"))[1]) / 1024
print(*(last - first for first, last in pairwise(marks)), memory)

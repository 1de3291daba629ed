# make demo      set up, build the example, print its certificate
# make check     set up; format, lint, types and the quick tests, with a C compiler and Icarus
# make test      that, and everything that a change could break in common use
# make test-all  that and the rest: mutants, proofs, exotic compilers, emulators (test-rest: these by themselves)
# make test-hdl  only the tests of the Verilog: simulation, mutants, proofs, lint, synthesis
# make test-long what is seldom worth its time: more seeds and combinations, tables of docs, 100,000 random swaps
# make durations where CPU time goes, by folder and by test, into build/durations.txt (OF=tests/emit: of these alone)
# make resources what the Verilog takes on FPGAs, into docs/resources.md
# make instructions what the C takes on Cortex-M and RISC-V, into docs/instructions.md, and what tables take, into the
#                package and docs/tables.md
# make link      what an upload takes, into docs/upload.md
# make fuzz      a million inputs for the C link, plain, with splines and shaping, with z, and with moves of slow parts,
#                with sanitizers
# make bench     tablegen beside what others use, into benchmarks/results.md (ONLY=line: that section)
# make cost      what a build costs, against importing numpy, and whether that is within its limits
# make figures   the pictures of the README and the docs; STAGE=FOLDER has the records of the real stage
# make notebooks the notebooks, run again, with what they show
# make site      the documentation as a site with a search, into build/site
# make man       the manual pages of all commands, into build/man
# make reference the pages of commands, keys and Python, into docs
# make paper     the paper's numbers beside ours, into docs/paper
# make check-python PYTHON=python3.13  `make check` under another Python, in an environment of its own
# make bare      both commands of the README in a Debian that has nothing else, on the last commit; as root (BARE=FOLDER)
# make clean     remove what these made

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Whose shared library `libpython` is.
export ENVIRONMENT_PYTHON := $(BIN)/python
# What is imported is compiled then, by whom it is; the rest of the packages, most of them, never.
INSTALL := $(BIN)/python -m pip --disable-pip-version-check --quiet install --no-compile

# What the README asks for; every list below adds to it.
README_PACKAGES := ca-certificates git gpgv make python3 python3-venv
# What the sets of tests compile, simulate, prove and synthesise with; tests/README.md tells the sets.
CHECK_TOOLS := gcc libc6-dev iverilog libpython
COMMON_TOOLS := $(CHECK_TOOLS) make g++ ccache clang libclang-rt-dev cmake ninja-build ghdl srecord tcl chromium groff man-db
HDL_TOOLS := make g++ ccache iverilog libpython yosys nextpnr-ice40 fpga-icestorm z3 gcc-riscv64-unknown-elf
FIRMWARE_TOOLS := gcc-arm-none-eabi qemu-system-arm gcc-avr avr-libc simavr gcc-riscv64-unknown-elf gcc-mips-linux-gnu \
    libc6-dev-mips-cross qemu-user \
    arduino-builder arduino-core-avr libsimavr-dev libelf-dev nodejs npm cargo
TOOLS := $(COMMON_TOOLS) $(HDL_TOOLS) $(FIRMWARE_TOOLS) cppcheck
# A process that has nothing more to do takes tests from the end of the other's: neighbours stay together, so that what
# they share is made once. OpenBLAS threads only spin beside the other processes. Half of what is compiled of each model
# of Verilator is its library, the same for all. Without bytecode every process compiles anew: the processes that run the
# tests hundreds of files, each command of tablegen that a test starts its modules, which doubles what it takes. A make
# that a test starts is no part of this one.
PYTEST := MAKEFLAGS= MFLAGS= PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 OBJCACHE=ccache CCACHE_DIR=$(CURDIR)/build/ccache $(BIN)/python -m pytest --numprocesses auto --dist worksteal

.PHONY: demo lint style types check run-quick test run-common test-rest test-all test-hdl test-long durations resources instructions link fuzz bench cost figures notebooks site man reference paper clean
.DELETE_ON_ERROR:

demo: $(VENV)/installed
	$(BIN)/tablegen build examples/annexin_200nm.toml -o build/demo

lint: style types

style: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/installed-test
	$(BIN)/mypy

# Types are checked in one process, beside the tests.
check: style
	@.ci/system-packages $(CHECK_TOOLS)
	@$(MAKE) --no-print-directory --jobs=2 types run-quick

test: style
	@.ci/system-packages $(COMMON_TOOLS)
	@$(MAKE) --no-print-directory --jobs=2 types run-common

run-quick:
	$(PYTEST) -m 'not (common or rest or long)'

run-common:
	$(PYTEST) -m 'not (rest or long)'

test-rest: $(VENV)/installed-test
	@.ci/system-packages $(TOOLS)
	$(PYTEST) -m 'rest and not long'

test-all:
	@$(MAKE) test
	@$(MAKE) test-rest

test-hdl: $(VENV)/installed-test
	@.ci/system-packages $(HDL_TOOLS)
	$(PYTEST) hdl_tests

test-long: $(VENV)/installed-test
	@.ci/system-packages $(TOOLS)
	$(PYTEST) -m long

# OF=FOLDER or FILE: of these tests alone; MARKS: of those of a set.
OF ?=
MARKS ?= not long
durations: $(VENV)/installed-test
	@.ci/system-packages $(TOOLS)
	DURATIONS=$(CURDIR)/build/durations.txt PYTHONPATH=tests/helpers $(PYTEST) -p durations -m '$(MARKS)' $(OF)
	@head -n 40 build/durations.txt

resources: $(VENV)/installed-test
	@.ci/system-packages $(HDL_TOOLS)
	$(BIN)/python benchmarks/resources.py --write

instructions: $(VENV)/installed-test
	@.ci/system-packages gcc-arm-none-eabi gcc-riscv64-unknown-elf yosys nextpnr-ice40
	$(BIN)/python benchmarks/firmware.py --write
	$(BIN)/python benchmarks/firmware_link.py --write
	$(BIN)/python benchmarks/tables.py --costs
	$(BIN)/python benchmarks/turned_costs.py --write
	$(BIN)/python benchmarks/tables.py --write

link: $(VENV)/installed-test
	@.ci/system-packages gcc-arm-none-eabi
	$(BIN)/python benchmarks/link.py --write
	$(BIN)/python benchmarks/slow_link.py --write

# What is found goes into build/fuzz; what reaches something new may go into the corpus: build/fuzz/link -merge=1.
FUZZ_RUNS ?= 1000000
FUZZED := $(wildcard firmware_templates/c/dac_*.[ch]) tests/runtime_c/fuzz/link_fuzz.c
# The runtime as most have it, with all that it can play, with a second sequencer for z, and of scans at an angle.
build/fuzz/link_all: FUZZ_FLAGS := -DDAC_SPLINE=1 -DDAC_SHAPING=3
build/fuzz/link_z: FUZZ_FLAGS := -DDAC_SPLINE=1 -DDAC_COMMIT_MODES=1 -DDAC_LINK_Z=1
build/fuzz/link_slow: FUZZ_FLAGS := -DDAC_SPLINE=1 -DDAC_SLOW_PART=1 -DDAC_MOVE=1
build/fuzz/link build/fuzz/link_all build/fuzz/link_z build/fuzz/link_slow: $(FUZZED)
	@.ci/system-packages clang libclang-rt-dev
	@mkdir -p $(@D)/found
	clang -std=c99 -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all -Wall -Wextra -Werror \
	    $(FUZZ_FLAGS) -Ifirmware_templates/c $(filter %.c,$(FUZZED)) -o $@

fuzz: build/fuzz/link build/fuzz/link_all build/fuzz/link_z build/fuzz/link_slow
	for target in $^; do $$target -runs=$(FUZZ_RUNS) -seed=1 -max_len=400 -timeout=10 -artifact_prefix=build/fuzz/ \
	    build/fuzz/found tests/runtime_c/fuzz/corpus || exit; done

# What tablegen is measured beside stands in an environment of its own.
OTHERS := build/bench/others
$(OTHERS)/installed: benchmarks/others.txt
	@.ci/virtual-environment $(PYTHON) $(OTHERS)
	$(OTHERS)/bin/python -m pip --disable-pip-version-check --quiet install --requirement $<
	@touch $@

ONLY ?=
bench: $(VENV)/installed-test $(OTHERS)/installed
	@.ci/system-packages gcc iverilog libpython yosys nextpnr-ice40 gcc-arm-none-eabi gcc-riscv64-unknown-elf gcc-avr avr-libc \
	    libsimavr-dev libelf-dev
	$(BIN)/python benchmarks/results.py $(ONLY:%=--only %)

cost: $(VENV)/installed
	$(BIN)/python benchmarks/build_cost.py

figures: $(VENV)/installed-plot
	$(BIN)/python docs/figures/make_figures.py
	$(BIN)/python docs/figures/make_readme.py
	$(BIN)/python docs/figures/make_virtual.py
	$(BIN)/python docs/figures/make_operator.py
	$(BIN)/python docs/figures/make_correct.py
	$(BIN)/python docs/figures/make_angle.py
	$(BIN)/python docs/figures/make_gallery.py
	$(BIN)/python docs/figures/make_evidence.py $(STAGE)
	@.ci/system-packages chromium
	$(BIN)/python docs/figures/make_report.py

notebooks: $(VENV)/installed-test
	$(BIN)/python docs/make_notebooks.py

site: $(VENV)/installed-docs
	$(BIN)/python docs/site/make_site.py build/site

man: $(VENV)/installed
	$(BIN)/python docs/make_man.py build/man

reference: $(VENV)/installed
	$(BIN)/python docs/make_configuration.py
	$(BIN)/python docs/make_reference.py

paper: $(VENV)/installed-plot
	$(BIN)/python docs/make_paper.py

# The stamps depend on what decides an installation, so that the second run finds nothing to do.
$(VENV)/installed: pyproject.toml
	@.ci/virtual-environment $(PYTHON) $(VENV)
	$(INSTALL) --editable .
	@touch $@

$(VENV)/installed-test: $(VENV)/installed
	$(INSTALL) --editable '.[test]'
	@touch $@

$(VENV)/installed-plot: $(VENV)/installed
	$(INSTALL) --editable '.[images,plot]'
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	$(INSTALL) --editable '.[docs]'
	@touch $@

# The Pythons that the package supports. `make test` runs the wheel under each further one that this machine has.
PYTHONS := 3.11 3.12 3.13
.PHONY: pythons check-python
test: pythons
pythons: $(VENV)/installed
	@.ci/further-pythons $(VENV) $(PYTHONS)

check-python:
	$(MAKE) check VENV=.venv-$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')

# The packages of lists, for scripts: make packages LIST='README_PACKAGES CHECK_TOOLS'
LIST ?= README_PACKAGES
.PHONY: packages bare
packages:
	@echo $(sort $(foreach list,$(LIST),$($(list))))

BARE ?= /tmp/tablegen-bare
bare:
	@.ci/bare-debian $(BARE)

clean:
	rm -rf $(VENV) .venv-* build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

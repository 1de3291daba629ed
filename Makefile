# make demo    set up, build the example, print its certificate
# make test    set up, check and run every test
# make bench   what a build costs, against importing numpy
# make figures the pictures of the README and the docs
# make clean   remove what these made

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: demo test bench figures clean
.DELETE_ON_ERROR:

demo: $(VENV)/installed
	$(BIN)/tablegen build examples/annexin_200nm.toml -o build/demo

test: $(VENV)/installed-test
	@.ci/system-packages gcc g++ clang libclang-rt-dev iverilog ghdl
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest

bench: $(VENV)/installed
	$(BIN)/python benchmarks/build_cost.py

figures: $(VENV)/installed-plot
	$(BIN)/python docs/figures/make_figures.py

# The stamps depend on what decides an installation, so that the second run finds nothing to do.
$(VENV)/installed: pyproject.toml
	@.ci/virtual-environment $(PYTHON) $(VENV)
	$(PIP) install --editable .
	@touch $@

$(VENV)/installed-test: $(VENV)/installed
	$(PIP) install --editable '.[test]'
	@touch $@

$(VENV)/installed-plot: $(VENV)/installed
	$(PIP) install --editable '.[plot]'
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

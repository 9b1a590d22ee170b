# Two commands that do all their set-up in a fresh clone:
#   make demo   installs sandboil into .venv, computes the level ground and draws it
#   make test   installs sandboil with its development tools into .venv and runs all tests
# They need Python 3.11 or later, Rust and a network.

PYTHON ?= python3
# The virtual environment.
VENV ?= .venv
# The package to install and the folder that holds the tests: `.ci/run` names a wheel, and a copy elsewhere.
PACKAGE ?= .
TREE ?= .

bin := $(abspath $(VENV))/bin
scene := examples/level_ground/scene.toml
out := out/level_ground

.PHONY: demo test

demo: $(VENV)/bin/pip
	$(bin)/pip install --quiet "$(PACKAGE)"
	$(bin)/sandboil plan $(scene)
	$(bin)/sandboil run $(scene) --out $(out) $(if $(wildcard $(out)/results.h5),--resume)
	$(bin)/sandboil plot $(out)
	@echo "The pictures are in $(out)/plots"

test: $(VENV)/bin/pip
	$(bin)/pip install --quiet "$(PACKAGE)[dev]"
	cargo test --workspace --locked
	cd $(TREE) && $(bin)/python -m pytest

$(VENV)/bin/pip:
	$(PYTHON) -m venv $(VENV)

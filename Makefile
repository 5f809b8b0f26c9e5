# `make demo` and `make test` need Python 3.11 or newer and nothing else.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test quick oldest lint fuzz mutants audit reliability docs wheel bench bench-compare weights thesis format clean help

help:
	@echo "make demo   install, drive through a synthetic street, leave a video in results/demo"
	@echo "make test   install with the developers' tools, lint, and run all tests on all cores"
	@echo "make quick  the tests that take less than five seconds, read no KITTI frames and train nothing"
	@echo "make oldest the tests with the oldest releases of the dependencies that pyproject.toml allows"
	@echo "make lint   ruff and mypy"
	@echo "make fuzz   damaged files for every parser; RUNS=1000000 for the long form, an hour on one core"
	@echo "make mutants  which small changes of the code the tests do not notice: hours"
	@echo "make audit  compare the installed packages with known vulnerabilities, where PyPI answers"
	@echo "make reliability  kill runs at 100 random moments and resume them: an hour on two cores"
	@echo "make docs   build the site into docs/_build, without a warning"
	@echo "make wheel  build the wheel and the source archive into dist, and check them"
	@echo "make weights train the networks that ship, on synthetic drives: about five hours on two cores"
	@echo "make thesis train and measure all of the thesis' section 7.2, as long as STEPS says"
	@echo "make bench  every stage beside its reference implementation and the best library"
	@echo "make bench-compare REV=main   processor time of each stage beside that of another revision, in turns"

demo: $(VENV)/.installed
	$(BIN)/trifuse demo

test: $(VENV)/.installed-dev lint
	$(BIN)/python -m pytest -n auto --dist loadfile

quick: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not slow and not kitti and not train"

# The tests with the oldest releases that pyproject.toml allows, in an environment of their own.
oldest:
	$(PYTHON) -m venv .venv-oldest
	.venv-oldest/bin/python -m pip install --quiet uv
	.venv-oldest/bin/uv pip install --quiet --python .venv-oldest/bin/python --resolution lowest-direct --editable ".[dev]"
	.venv-oldest/bin/python -m pytest -n auto --dist loadfile

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2

# Files that no parser may stumble over: RUNS executions each, PARSERS="scan image" for some of them.
RUNS ?= 20000
PARSERS ?=
fuzz: $(VENV)/.installed-fuzz
	$(BIN)/python -m tests.fuzz.guided $(PARSERS) --runs $(RUNS)

# Small changes of the code that the tests have to notice; `mutmut browse` shows those that they did not.
mutants: $(VENV)/.installed-fuzz
	$(BIN)/mutmut run $(MUTANTS)

# Where PyPI tells of no vulnerability in a release that has some, there is nothing to compare with: no network, or a
# mirror without this list, with which pip-audit finds nothing and says so. A vulnerability ends with exit code 1.
audit: $(VENV)/.installed-dev
	@if $(BIN)/python -c 'import json, urllib.request as r; \
	  assert json.load(r.urlopen("https://pypi.org/pypi/pip/23.0/json", timeout=10))["vulnerabilities"]' 2>/dev/null; \
	then $(BIN)/python -m pip install --quiet pip-audit && $(BIN)/pip-audit --skip-editable --progress-spinner off; \
	else echo "audit skipped: pypi.org tells of no vulnerabilities here"; fi

KILLS ?= 100
reliability: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n 0 tests/cli/test_resume.py --kills $(KILLS)

docs: $(VENV)/.installed-dev
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build

wheel: $(VENV)/.installed-dev
	rm -rf dist
	$(BIN)/python -m build
	$(BIN)/twine check --strict dist/*

# What the shipped networks have learned from: other worlds than they are judged by, none of them real. The camera
# view starts from public weights of photographs: fetched, or PUBLIC_WEIGHTS=PATH.
PUBLIC_WEIGHTS ?= results/weights/yolox_nano.onnx
# With TRIAL=20 every line runs with 20 frames of each kind and one epoch, and what ships stays as it is.
TRIAL ?=
WEIGHTS ?= results/$(if $(TRIAL),weights-trial,weights)
SYNTH := $(WEIGHTS)/synth
SHIPPED := $(if $(TRIAL),$(WEIGHTS)/shipped,perception/detection/weights)
CLASSES := Car,Van,Truck,Pedestrian,Cyclist
weights: $(VENV)/.installed-dev
	mkdir -p $(SHIPPED)
	$(BIN)/trifuse batch synth $(SYNTH)/train --layout object --frames $(or $(TRIAL),800) --seed 1000
	$(BIN)/trifuse batch synth $(SYNTH)/train2 --layout object --frames $(or $(TRIAL),400) --seed 40000
	$(BIN)/trifuse batch synth $(SYNTH)/train3 --layout object --frames $(or $(TRIAL),360) --seed 60000
	$(BIN)/trifuse batch synth $(SYNTH)/depthcn --layout object --frames $(or $(TRIAL),1600) --seed 1000
	$(BIN)/trifuse batch synth $(SYNTH)/val --layout object --frames $(or $(TRIAL),100) --seed 5000
	$(BIN)/trifuse batch synth $(SYNTH)/test --layout object --frames $(or $(TRIAL),240) --seed 9000
	$(BIN)/trifuse batch synth $(SYNTH)/fusion --layout object --frames $(or $(TRIAL),200) --seed 20000
	$(BIN)/trifuse batch synth $(SYNTH)/fusion2 --layout object --frames $(or $(TRIAL),120) --seed 80000
	$(MAKE) $(PUBLIC_WEIGHTS)
	$(BIN)/trifuse train detector $(SYNTH)/train $(SYNTH)/train2 $(SYNTH)/train3 --validation $(SYNTH)/val \
	  --modality rgb --config yolox $(if $(TRIAL),--epochs 1) \
	  --model.weights.public $(PUBLIC_WEIGHTS) --out $(WEIGHTS)/rgb
	$(BIN)/trifuse export $(WEIGHTS)/rgb/best.ckpt --size 256x896 --out $(SHIPPED)/rgb_yolox.onnx \
	  --data $(SYNTH)/val
	for modality in dm rm; do \
	  $(BIN)/trifuse train detector $(SYNTH)/train $(SYNTH)/train2 --validation $(SYNTH)/val --modality $$modality \
	    --model.classes $(CLASSES) --epochs $(if $(TRIAL),1,7) --out $(WEIGHTS)/$$modality-first && \
	  $(BIN)/trifuse train detector $(SYNTH)/train $(SYNTH)/train2 $(SYNTH)/train3 --validation $(SYNTH)/val \
	    --modality $$modality --model.classes $(CLASSES) --epochs $(if $(TRIAL),1,9) --seed 1 \
	    --model.weights.checkpoint $(WEIGHTS)/$$modality-first/best.ckpt --out $(WEIGHTS)/$$modality && \
	  $(BIN)/trifuse export $(WEIGHTS)/$$modality/best.ckpt --out $(WEIGHTS)/$$modality.onnx \
	    --data $(SYNTH)/val --int8 && \
	  cp $(WEIGHTS)/$$modality.onnx $(SHIPPED)/$${modality}_compact.onnx || exit 2; \
	done
	$(BIN)/trifuse train fusion $(SYNTH)/fusion $(SYNTH)/fusion2 --data.shares 75,15,10 \
	  --data.models.rgb $(SHIPPED)/rgb_yolox.onnx --data.models.dm $(SHIPPED)/dm_compact.onnx \
	  --data.models.rm $(SHIPPED)/rm_compact.onnx \
	  --out $(WEIGHTS)/fusion
	cp $(WEIGHTS)/fusion/fusion.onnx $(SHIPPED)/fusion_default.onnx
	$(BIN)/trifuse train depthcn $(SYNTH)/depthcn --validation $(SYNTH)/val --epochs $(if $(TRIAL),1,6) --out $(WEIGHTS)/depthcn
	$(BIN)/trifuse export $(WEIGHTS)/depthcn/best.ckpt --out $(WEIGHTS)/depthcn.onnx --data $(SYNTH)/test
	cp $(WEIGHTS)/depthcn.onnx $(SHIPPED)/depthcn_default.onnx
	$(MAKE) weights-bev
	$(BIN)/trifuse evaluate detection $(SYNTH)/test
	$(BIN)/trifuse evaluate detection $(SYNTH)/test --detector depthcn

# Scans of ten sensors, each at its height in metres, in streets of many kinds.
BEV_SENSORS := HDL-64E:1.73 HDL-32E:1.84 HDL-32E:2.1 VLP-16:1.9 VLP-16:1.0 VLP-32C:1.6 VLS-128:1.9 OS1-32:2.0 OS1-64:2.2 \
  OS1-128:2.6 Pandar64:2.4
BEV_STREETS := town housing main-road junction industrial cycling shopping jam furnished furnished
weights-bev: $(VENV)/.installed-dev
	mkdir -p $(WEIGHTS) $(SHIPPED)
	seed=200000; for sensor in $(BEV_SENSORS); do \
	  file=$(WEIGHTS)/$$sensor.yaml; \
	  printf 'model: %s\nheight_m: %s\n' $${sensor%:*} $${sensor#*:} > $$file || exit 2; \
	  for street in $(BEV_STREETS); do seed=$$((seed + 1000)); \
	    $(BIN)/trifuse batch synth $(SYNTH)/bev/$$seed --layout object --frames $(or $(TRIAL),45) --sensor $$file \
	      --no-images --seed $$seed --street $$street || exit 2; \
	  done; \
	done
	for sensor in HDL-64E HDL-32E; do $(BIN)/trifuse batch synth $(SYNTH)/bev-val/$$sensor --layout object \
	  --frames $(or $(TRIAL),40) --sensor $$sensor --no-images --seed 90000 || exit 2; done
	$(BIN)/trifuse train detector $(SYNTH)/bev/* \
	  --validation $(SYNTH)/bev-val/HDL-64E,$(SYNTH)/bev-val/HDL-32E --modality bev --epochs $(if $(TRIAL),1,60) \
	  --batch-size 16 --data.augmentation.crop 0.5 --lr 0.003 --out $(WEIGHTS)/bev
	$(BIN)/trifuse export $(WEIGHTS)/bev/best.ckpt --out $(WEIGHTS)/bev.onnx --data $(SYNTH)/bev-val/HDL-32E --int8
	cp $(WEIGHTS)/bev.onnx $(SHIPPED)/bev_centers.onnx

# Its content is compared with a hash when it is read.
$(PUBLIC_WEIGHTS):
	mkdir -p $(@D)
	curl --fail --location --output $@ \
	  $$($(BIN)/python -c 'from train.detector.initial_network import ADDRESS; print(ADDRESS)')

# All of 7.2, on KITTI where KITTI_ROOT is set. 80200 steps of three YOLOv2 are days of a GPU; what is done is not
# done again. Two cores: make thesis STEPS=100 FRAMES=100 FLAGS="--detectors default --epochs 4 --fit-steps 15"
STEPS ?= 80200
FRAMES ?= 300
FLAGS ?=
thesis: $(VENV)/.installed-dev
	$(BIN)/python -m perception study thesis --steps $(STEPS) --frames $(FRAMES) $(FLAGS)

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/.installed-dev $(VENV)/.installed-bench
	$(BIN)/trifuse bench

# On a synthetic street, or on real frames where KITTI_ROOT is set.
REV ?= main
bench-compare: $(VENV)/.installed-dev
	$(BIN)/python -m perception bench --compare $(REV) \
	  $(if $(KITTI_ROOT),--drive $(KITTI_ROOT)/tracking --sequence 0000) $(FLAGS)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "$(PYTHON): expected Python 3.11 or newer, found $$($(PYTHON) --version 2>&1); set PYTHON=python3.11"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/.installed: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

# It demands older releases of rosbags and psutil, which reading packets does not need.
OUSTER := "ouster-sdk>=1.0"
$(VENV)/.installed-dev: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	$(BIN)/python -m pip install --quiet --no-deps $(OUSTER)
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-fuzz: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[fuzz]"
	@touch $@

$(VENV)/.installed-bench: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable ".[bench]"
	@touch $@

clean:
	rm -rf $(VENV) results

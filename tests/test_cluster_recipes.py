"""The recipes for clusters: the SLURM job is run with a stand-in for srun, the manifest is read."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from perception.cli.main import run_command_line
from tests.car_frames import write_car_frames

CLUSTER = Path(__file__).parents[1] / "docs" / "examples" / "cluster"

# Starts the tasks of a step as processes of this machine.
SRUN = """#!/bin/bash
while [[ $1 == --* ]]; do shift; done
for task in $(seq "$SLURM_NTASKS"); do "$@" & done
trap 'kill $(jobs -p)' TERM
wait
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="a job of SLURM is a shell script")
def test_a_slurm_job_writes_the_files_of_one_process(tmp_path):
    for name in "ab":
        write_car_frames(tmp_path / "drives" / name, frames=2)
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "srun").write_text(SRUN)
    (tools / "srun").chmod(0o755)
    path = os.pathsep.join([str(tools), str(Path(sys.executable).parent), os.environ["PATH"]])
    repository = str(CLUSTER.parents[2])
    environment = {**os.environ, "PATH": path, "SLURM_NTASKS": "2", "PYTHONPATH": repository}

    words = ["maps", "drives/*", "--out", "fleet", "--all"]
    said = subprocess.run(
        ["bash", str(CLUSTER / "slurm.sh"), *words],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr

    rows = [json.loads(line) for line in (tmp_path / "fleet/drives.jsonl").read_text().splitlines()]
    assert [(row["name"], row["state"]) for row in rows] == [("a", "done"), ("b", "done")]
    run_command_line(
        ["maps", str(tmp_path / "drives/a"), "--all", "--out", str(tmp_path / "alone")]
    )
    alone = sorted(path for path in (tmp_path / "alone").rglob("*.png"))
    assert alone
    for path in alone:
        of_job = tmp_path / "fleet/drives/a" / path.relative_to(tmp_path / "alone")
        assert of_job.read_bytes() == path.read_bytes()
    assert not list(tmp_path.glob("scheduler.*"))  # the job leaves its results alone


def test_the_parts_of_the_manifest_find_each_other():
    documents = list(yaml.safe_load_all((CLUSTER / "kubernetes.yaml").read_text()))
    of_kind = {(one["kind"], one["metadata"]["name"]): one["spec"] for one in documents}
    pods = [spec["template"] for spec in of_kind.values() if "template" in spec]
    for kind in (("Deployment", "trifuse-scheduler"), ("Deployment", "trifuse-worker")):
        spec = of_kind[kind]
        assert spec["selector"]["matchLabels"] == spec["template"]["metadata"]["labels"]

    service = of_kind["Service", "trifuse-scheduler"]
    scheduler = of_kind["Deployment", "trifuse-scheduler"]["template"]
    assert service["selector"] == scheduler["metadata"]["labels"]
    address = f"tcp://trifuse-scheduler:{service['ports'][0]['port']}"
    (worker,) = of_kind["Deployment", "trifuse-worker"]["template"]["spec"]["containers"]
    (batch,) = of_kind["Job", "trifuse-batch"]["template"]["spec"]["containers"]
    assert address in worker["command"]
    assert address in batch["command"]

    containers = [container for pod in pods for container in pod["spec"]["containers"]]
    assert len({container["image"] for container in containers}) == 1  # one version everywhere
    mounts = [one["volumeMounts"] for one in (worker, batch)]
    assert mounts[0] == mounts[1]  # the same paths hold on both

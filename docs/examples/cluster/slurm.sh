#!/bin/bash
#SBATCH --job-name=trifuse
#SBATCH --ntasks=100
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=4G
#SBATCH --time=12:00:00
#SBATCH --requeue
# One job: a scheduler, a worker a task, and the batch that is given behind the name of this file, such as
#   sbatch slurm.sh run /shared/drives.txt --out /shared/fleet --no-video
# Submitted again, it goes on where it stopped.
set -eu

folder=$(mktemp -d -p "$PWD" scheduler.XXXXXX)  # where all nodes see it
jobs=()  # the last one first: workers, then their scheduler
trap 'for job in ${jobs[@]+"${jobs[@]}"}; do kill "$job" && wait "$job" || true; done; rm -rf "$folder"' EXIT
trap 'exit 143' TERM  # at the end of the time

# Machines come and go: a drive is given up after ten workers died over it.
export DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES=10
dask scheduler --scheduler-file "$folder/scheduler.json" --port 0 --dashboard-address :0 &
jobs=($!)
until [ -s "$folder/scheduler.json" ]; do sleep 0.2; done

srun --cpu-bind=cores --kill-on-bad-exit=0 \
    dask worker --scheduler-file "$folder/scheduler.json" --nthreads 1 --local-directory "${TMPDIR:-/tmp}" \
    --death-timeout 60 --dashboard-address :0 --preload data.batch.one_core &
jobs=($! "${jobs[@]}")

trifuse batch "$@" --scheduler "$folder/scheduler.json"

#!/bin/bash
#SBATCH --job-name=seeds
#SBATCH --array=0-3
#SBATCH --partition=batch
#SBATCH --time=08:00:00
#SBATCH --cpus-per-task=4
#SBATCH --mem=2G
#SBATCH --signal=B:USR1@120
#SBATCH --open-mode=append
#SBATCH --output=/work/cluster/seeds/slurm-%a.log
#SBATCH --requeue
# Each task is a run of the sweep in this folder, and goes on where it stopped.
cd /work/cluster || exit
trap 'echo "time is nearly up: to be gone on with"; scontrol requeue "$SLURM_JOB_ID"' USR1
/work/venv/bin/python -m pipeline cluster run /work/cluster/seeds "$SLURM_ARRAY_TASK_ID" &
run=$!
while :; do
  wait "$run"
  code=$?
  kill -0 "$run" 2>/dev/null || exit "$code" # else a signal ended the waiting, not the run
done

#!/bin/sh
# Runs a job on a Slurm cluster, in parts, and makes the parts one: slurm.sh JOB.toml OUT [PARTS]
# The same command again goes on with a run of which parts have failed.
set -eu

job=$1
out=$2
parts=${3:-16}

# `auto` takes the part from the array's task. `--resume` begins a part, goes on with it, or finds it finished.
array=$(sbatch --parsable --job-name=beamcast --array="1-$parts" --cpus-per-task=8 --mem=4G --requeue \
    --wrap="beamcast scan '$job' --out '$out' --resume --shard auto --threads \$SLURM_CPUS_PER_TASK")

# It runs when all parts have ended well, and fails if a file is not as it was written.
sbatch --parsable --job-name=beamcast-merge --dependency="afterok:${array%%;*}" --kill-on-invalid-dep=yes \
    --wrap="beamcast merge '$out' && beamcast verify '$out'"

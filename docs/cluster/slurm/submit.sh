#!/bin/bash
# submit.sh FILTER.json [OPTIONS of kfdesign montecarlo]
#
# RUNS (default 1000) runs as a Slurm array of SHARDS (default 10) tasks, and a job that merges them when all are done. Files are
# written to the current directory, which every node must see. Submitted again, it goes on where the shards' files end.
# Slurm's own options come from its variables (SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT, ...).

set -eu
here=$(cd "$(dirname "$0")" && pwd)
export RUNS=${RUNS:-1000} SHARDS=${SHARDS:-10}
if (($# == 0 || SHARDS < 1 || RUNS < SHARDS)); then
    echo "usage: [RUNS=1000] [SHARDS=10] submit.sh FILTER.json [OPTIONS of kfdesign montecarlo]; RUNS >= SHARDS >= 1" >&2
    exit 2
fi

array=$(sbatch --parsable --array="0-$((SHARDS - 1))" "$here/montecarlo.sbatch" "$@")
array=${array%%;*} # "ID;CLUSTER" where there are several clusters
merge=$(sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes "$here/merge.sbatch")
echo "array $array, merge ${merge%%;*}"

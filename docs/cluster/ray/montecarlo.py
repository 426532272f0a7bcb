#!/usr/bin/env python3
"""kfdesign montecarlo as Ray tasks: one shard a task, then the merge.

    montecarlo.py FILTER.json [--runs 1000] [--shards 10] [--threads 1] [OPTIONS of kfdesign montecarlo]

Files are written to the current directory, which every node must see under the same path; kfdesign must be on every node's PATH.
A shard whose node is lost, or whose program is killed, is tried again and goes on from its checkpoint, as does a second start of this script.
The exit status is that of `kfdesign merge`: 0 consistent, 1 inconsistent, 2 could not.
"""

import argparse
import os
import subprocess
import sys

import ray


class Killed(Exception):
    """kfdesign was ended by a signal: worth another try."""


@ray.remote(max_retries=3, retry_exceptions=[Killed])
def run_shard(folder, shard, first, last, arguments):
    name = f"shard-{shard}.json"
    command = ["kfdesign", "montecarlo", *arguments, "--runs", f"{first}..{last}", "-o", name, "--resume"]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode < 0:
        raise Killed(f"shard {shard}: kfdesign ended by signal {-done.returncode}")
    if done.returncode > 1:  # 1: these runs alone are inconsistent; the merged document has the verdict
        raise RuntimeError(f"shard {shard}: {done.stderr.strip()}")
    return name


def main():
    parser = argparse.ArgumentParser(description="kfdesign montecarlo as Ray tasks", allow_abbrev=False)
    parser.add_argument("filter", help="filter.json")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--shards", type=int, default=10)
    parser.add_argument("--threads", type=int, default=1, help="of each shard")
    known, options = parser.parse_known_args()
    if not 1 <= known.shards <= known.runs:
        parser.error("1 <= shards <= runs is needed")

    folder = os.getcwd()
    arguments = [os.path.abspath(known.filter), "--threads", str(known.threads), *options]
    task = run_shard.options(num_cpus=known.threads)
    bounds = [known.runs * shard // known.shards for shard in range(known.shards + 1)]
    try:
        ray.init()  # the cluster of $RAY_ADDRESS, else this machine
        files = ray.get([task.remote(folder, i, bounds[i], bounds[i + 1], arguments) for i in range(known.shards)])
    except (ray.exceptions.RayError, ConnectionError) as error:
        print(getattr(error, "cause", error), file=sys.stderr)
        return 2
    merge = ["kfdesign", "merge", *files, "-o", "montecarlo.json", "--junit", "montecarlo.xml", "--report", "montecarlo.html"]
    return subprocess.run(merge, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())

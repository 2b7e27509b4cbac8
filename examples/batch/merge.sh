#!/usr/bin/env bash
# Joins the shards that muons.slurm or muons.sub made to muons.h5, and checks it.

#SBATCH --job-name=merge-muons
#SBATCH --mem=1G
#SBATCH --time=04:00:00

set -euo pipefail
deepmuon-merge shard-*.h5 -o muons.h5
deepmuon-check muons.h5

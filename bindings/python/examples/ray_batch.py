"""Levels of detail for all models of a folder on a Ray cluster, with a table of the results.

    python ray_batch.py IN OUT

IN and OUT are folders that all machines of the cluster can access, such as s3://bucket/models.
"""

import sys

import pyarrow.compute as pc
import ray

from lodsmith import batch

source, target = sys.argv[1:]
ray.init(log_to_driver=False)  # ray.init(address="auto") on a machine of a cluster
table = batch.run(source, target, levels=[0.5, 0.2, 0.05], preset="visual", timeout=120)

failed = table.filter(pc.is_valid(table["failure"]))
levels = table.filter(pc.is_null(table["failure"]))
print(f"{len(set(levels['input'].to_pylist()))} models, {len(levels)} levels; {len(failed)} failed")
for row in failed.to_pylist():
    print(f"{row['input']}: {row['failure']}")
missed = levels.filter(pc.invert(levels["reached"]))
print(f"{len(missed)} levels did not reach their count")

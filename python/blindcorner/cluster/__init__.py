# SPDX-License-Identifier: Apache-2.0
"""Fits and trials on more than one machine, by Dask (docs/cluster.md).

    from distributed import Client
    import blindcorner.cluster as cluster

    cluster.trials("scenes/street_trials_drive.json", 1200, Client("tcp://head:8786"), "out")

One task is a chunk of captures or trials. Whatever the number of workers and the order in which they
finish, the files are those of one machine. Finished work counts only once it is in the directory's
journal, on disk. After a killed worker, a restarted scheduler or a full disk, the same call goes on
from there.
"""

from ._fit import fit, sweep
from ._trials import TrialSummary, trials

__all__ = ["TrialSummary", "fit", "sweep", "trials"]

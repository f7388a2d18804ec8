"""Campaigns: a TOML file in, rows out, over any concurrent.futures.Executor.

    Campaign         a TOML file            -> jobs         what to measure; pure data
    run_job          a job                  -> rows         a mesh marked once, attacked by everything, read each time
    run              a campaign, a folder   -> progress     only what the folder's rows lack; kill it at any moment
    read_rows        a folder               -> rows

A row says how one reading went. Corr and bit errors are of the raw bits against those embedded; ``message_ok`` is the
message through the code, where the bits carry one; ``p_value`` tests for the bits that were embedded, all tries of the
reader charged. ``mrms``, ``hausdorff`` and ``msdm`` are what the mark cost, over the cover's diagonal where they are
lengths. ``failure`` is null, or the reason why there is nothing else.
"""

from o3dmark.campaign.execution import Progress, about, load, run
from o3dmark.campaign.job import Trial, failed_rows, run_job, trial
from o3dmark.campaign.ledger import Ledger, read_rows
from o3dmark.campaign.plan import Campaign, Case, Job, Source
from o3dmark.campaign.pool import dask_cluster, process_pool

__all__ = [
    "Campaign",
    "Case",
    "Job",
    "Ledger",
    "Progress",
    "Source",
    "Trial",
    "about",
    "dask_cluster",
    "failed_rows",
    "load",
    "process_pool",
    "read_rows",
    "run",
    "run_job",
    "trial",
]

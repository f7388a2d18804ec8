"""Campaigns: a TOML file in, rows out, over any concurrent.futures.Executor.

    read_campaign    a TOML file            -> Campaign     what to measure; pure data
    Campaign.jobs                           -> jobs         a mesh, a method, a seed, and all that is to be done to them
    run_job          a job                  -> rows         the mesh marked once, attacked by everything, read each time
    run              a campaign, a folder   -> progress     only what the folder's rows lack; kill it at any moment
    read_rows        a folder               -> rows         each a `Row`
    load             a folder               -> Kept         its campaign, the runs that computed its rows
    compact          a folder               -> rows.csv     what a repository keeps

The TOML format stands in `spec_file`, the fields of a row in `row`, the files of a folder in `folder` and `pictures`.
"""

from o3dmark.campaign.execution import Progress, run
from o3dmark.campaign.folder import Kept, Run, load
from o3dmark.campaign.job import Outcome, failed, run_job
from o3dmark.campaign.keeping import compact, summarise
from o3dmark.campaign.ledger import Ledger
from o3dmark.campaign.plan import Campaign, Case, Gallery, Job, Source
from o3dmark.campaign.plugins import Plugin
from o3dmark.campaign.pool import dask_cluster, process_pool
from o3dmark.campaign.row import Row, describe_fields, read_rows
from o3dmark.campaign.spec_file import find_spec, read_campaign
from o3dmark.campaign.specimen import Specimen

__all__ = [
    "Campaign",
    "Case",
    "Gallery",
    "Job",
    "Kept",
    "Ledger",
    "Outcome",
    "Plugin",
    "Progress",
    "Row",
    "Run",
    "Source",
    "Specimen",
    "compact",
    "dask_cluster",
    "describe_fields",
    "failed",
    "find_spec",
    "load",
    "process_pool",
    "read_campaign",
    "read_rows",
    "run",
    "run_job",
    "summarise",
]

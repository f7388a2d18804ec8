"""Campaigns: a TOML file in, rows out, over any concurrent.futures.Executor.

    read_campaign    a TOML file            -> Campaign     what to measure; pure data
    Campaign.jobs                           -> jobs         a mesh, a method, a seed, and all that is to be done to them
    run_job          a job                  -> rows         the mesh marked once, attacked by everything, read each time
    run              a campaign, a folder   -> progress     only what the folder's rows lack; kill it at any moment
    read_rows        a folder               -> rows         each a `Row`
    load             a folder               -> Kept         its campaign, the runs that computed its rows
    compact          a folder               -> rows.csv     what a repository keeps

The TOML format stands in `spec_file`, the fields of a row in `row`, the files of a folder in `folder` and `pictures`.
The public names stand in ``__init__.pyi``; each is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The floor on an engine: every slot of every tester, spread over Ray, Dask, Spark or this machine's threads.

A worker needs a FLEET.toml, the files that it names and the library of tables; it keeps nothing and knows nothing of the store. What it gives back for a slot is
the row that `servotune fleet run` would have written, which depends on the slot, the settings and the library only. So tables, pages and store are the same for
every engine and any number of workers; a worker that dies is replaced by its engine, what came back twice is kept once, and a run that ends early goes on where
it was when it is started again.
"""

from servotune.floor.run import ENGINES, EngineFailed, Ran, run

__all__ = ["ENGINES", "EngineFailed", "Ran", "run"]

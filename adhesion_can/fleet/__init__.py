"""Many recordings to one Parquet data set, on dask.distributed (extra `fleet`).

Above `api`, whose functions work on one recording, and below the command: `schema` has the tables,
`units` finds the recordings, `analysis` works on one of them, `dataset` keeps what it gave, and
`run` passes all of them to the workers of a cluster.
"""

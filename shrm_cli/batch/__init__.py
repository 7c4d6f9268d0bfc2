"""Many maps at once: the product of probes, BRDFs and forms, on one machine or on a cluster.

`entry` says what is to be made, `manifest` reads it from a file, and `job` is one output. `work` is
what a worker does with the jobs of one probe, and `run` hands them to the workers of `batch` or
`cluster`.
"""

"""Many runs of the FMU: axes or a file of runs in, a row a run out, on Dask or in this process."""

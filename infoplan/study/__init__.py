"""Studies: configurations x seeds through a pool of workers into tables."""

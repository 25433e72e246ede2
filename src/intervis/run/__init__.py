"""A drive processed frame by frame: results on disk, their summary, and the report of a run."""

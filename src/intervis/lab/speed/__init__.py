"""Speed: the package's work timed beside that of other tools, interleaved in one run."""

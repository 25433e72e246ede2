"""Compiled kernels of the readers, in a folder of their own: see `intervis.kernels`."""

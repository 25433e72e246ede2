"""Compiled kernels of the uses: walks through grids of voxels."""

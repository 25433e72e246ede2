"""Delaunay triangulation of positions in the plane, exact for every input, as compiled kernels.

The on-disk cache of a kernel depends on all source files of its folder (`intervis.kernels`), so an
edit elsewhere in the package does not recompile these.
"""

from intervis.delaunay.triangulation import Triangulation, triangulate

__all__ = ["Triangulation", "triangulate"]

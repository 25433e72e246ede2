"""Compiled kernels of the sight engine. Only compiled code and its data layouts live here.

The on-disk cache of a kernel depends on all source files of its folder (`intervis.kernels`), so an
edit elsewhere in the package recompiles nothing.

What numba requires of this code:

- A kernel that receives arrays increments and decrements their reference counts atomically, unless
  the compiler can remove these calls. It can where the arrays are last used in one loop that every
  path through the kernel reaches. Therefore each pass over samples is one loop at the end of its
  kernel and calls no kernel that takes arrays.
- A NamedTuple argument is unpacked into its members. Functions that run once per sample or per line
  receive scalars or one row of an index array, not tuples that hold arrays.
- Loops over samples are vectorised only if they contain no branch, no table look-up and a trip
  count that is known to be a multiple of eight. Computation and look-up are therefore separate
  passes, and the samples of a line are padded to a multiple of eight.
- Unsigned 32-bit indices avoid the test for negative indices at each look-up.
- Constants are compiled in. Numbers that may be fitted again are passed at run time
  (`parameters`).
"""

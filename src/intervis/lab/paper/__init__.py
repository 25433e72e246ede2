"""The paper's experiments on any drive: what its tables and figures rest on, as data.

Bai, Li and Cen, "Dynamic Intervisibility Analysis of 3D Point Clouds" (2021), Sec. 3 and 4. Pages
and pictures are made from these data by `intervis.lab.paper.report`.
"""

"""The experiments of the paper, repeated on any drive: data, tables, figures and claims.

Bai, Li and Cen, "Dynamic Intervisibility Analysis of 3D Point Clouds" (2021), Sec. 3 and 4.
`intervis.lab.paper.report` writes the results as a page, tables and pictures.
"""

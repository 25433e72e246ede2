"""Calibration: every fitted number of the package, fitted again from named inputs.

`intervis calibrate` reads a plan (`plan`), which names drives, built-in worlds, pairs and
protocols, and fits in this order:

1. `curves`: log-odds over depth and height, and the attenuation, by penalised maximum likelihood of
   held-out returns;
2. `weights`: decay and correlation of the scan weights, on a grid, by the same likelihood;
3. `probability`: sharpness and change fractions, by maximum likelihood with the curves fixed;
4. `thresholds`: smallest probability of "visible" and smallest surface part of "occluded" that
   reach a stated precision in exact worlds;
5. `granularity`: TPI lost against nodes, and the time model, of ``tau="auto"``.

`outcome` writes the numbers with their provenance in the format of
`intervis/sight/occupancy_model.toml` and `intervis/method/granularity.toml`.
"""

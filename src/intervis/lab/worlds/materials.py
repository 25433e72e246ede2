"""Materials of the street."""

from intervis.lab.worlds.triangles import Material

ASPHALT = Material("road", (0.11, 0.11, 0.115), 0.28)
PARKING = Material("road", (0.15, 0.145, 0.14), 0.32)
PAINT = Material("marking", (0.75, 0.75, 0.72), 0.62)
KERB = Material("kerb", (0.42, 0.41, 0.39), 0.36)
SLABS = Material("sidewalk", (0.33, 0.32, 0.30), 0.33)
GRASS = Material("terrain", (0.11, 0.20, 0.05), 0.42)
EARTH = Material("terrain", (0.22, 0.16, 0.10), 0.33)
LEAF = Material("vegetation", (0.10, 0.21, 0.04), 0.46)
HEDGE = Material("vegetation", (0.055, 0.13, 0.035), 0.44)
BARK = Material("trunk", (0.16, 0.115, 0.08), 0.30)
STEEL = Material("pole", (0.35, 0.36, 0.37), 0.40)
GLASS = Material("glass", (0.03, 0.04, 0.05), 0.12)
PANE = Material("window", (0.06, 0.08, 0.10), 0.15)
TILE = Material("roof", (0.33, 0.12, 0.07), 0.32)
CONCRETE = Material("bridge", (0.42, 0.41, 0.38), 0.38)
WOOD = Material("fence", (0.30, 0.20, 0.11), 0.36)
TYRE = Material("car", (0.02, 0.02, 0.02), 0.06)

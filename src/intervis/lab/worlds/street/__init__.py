"""The built-in street: terrain, houses, vegetation, vehicles and people as triangles."""

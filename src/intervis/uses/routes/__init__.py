"""Sight along a route: targets and zones, and the sight distance of a road."""

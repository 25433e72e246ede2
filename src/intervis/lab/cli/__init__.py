"""Command-line front ends of the laboratory."""

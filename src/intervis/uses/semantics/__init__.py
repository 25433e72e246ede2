"""Classes of returns: what blocks a sight line, and scenes that leave some classes out."""

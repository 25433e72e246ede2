"""Accuracy of sight lines: ground truth from held-out returns and exact worlds, and scores."""

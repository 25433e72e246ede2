"""Voxels around a frame: free, occupied, occluded or unknown; and files of visibility masks."""

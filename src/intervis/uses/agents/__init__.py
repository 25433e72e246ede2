"""Which agents see each other, frame by frame."""

"""The commands of `intervis.lab`."""

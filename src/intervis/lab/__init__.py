"""What uses the library: simulated worlds, accuracy evaluation and the experiments of the paper.

The library never imports it.
"""

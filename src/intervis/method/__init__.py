"""The paper's method: one module for each step, in the paper's order; `analysis` runs them all."""

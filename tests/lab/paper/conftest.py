"""One small frame through the paper's experiments, for the tests of tables and claims."""

import pytest
from rough_ground import rough_ground

from intervis.drives import Frame
from intervis.lab.paper import experiment


@pytest.fixture(scope="session")
def result():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "SWEEP", (1, 5, 35, *experiment.printed_values.TAUS))
        patch.setattr(experiment, "SWEEP_RUNS", 1)
        patch.setattr(experiment.printed_values, "RUNS", 2)
        return experiment.run_frame(Frame(0, rough_ground(8, 2000)[:, :3]))

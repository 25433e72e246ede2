"""The curve of TPI lost against the method itself."""

import numpy as np
import pytest
from rough_ground import rough_ground

from intervis import Settings, analyze
from intervis.drives import Frame
from intervis.lab.paper import curve
from intervis.lab.paper.curve import tpi_curve


def test_tpi_lost_is_counted_from_the_best_finer_granularity(monkeypatch):
    monkeypatch.setattr(curve, "TAU_CANDIDATES", (2, 7, 20, 60, 150, 180))
    frames = [Frame(k, rough_ground(k, 2000)[:, :3]) for k in range(3)]
    notes = []
    points = tpi_curve(frames, Settings(view="circle"), progress=notes.append)
    assert [point.tau for point in points] == [2, 7, 20, 60, 150]
    assert len(notes) == 3
    tpi = {
        tau: [
            analyze(frame.points, settings=Settings(tau=tau, view="circle")).measures.TPI
            for frame in frames
        ]
        for tau in (2, 7, 20, 60, 150)
    }
    for k, point in enumerate(points):
        finer = [tpi[one.tau] for one in points[: k + 1]]
        lost = np.max(finer, axis=0) - tpi[point.tau]
        assert point.nodes == -(-2000 // point.tau)
        assert point.TPI == pytest.approx(np.mean(tpi[point.tau]))
        assert point.mean_lost == pytest.approx(lost.mean())
        assert point.most_lost == pytest.approx(lost.max())
        assert point.total_ms > 0
    assert points[-1].most_lost > points[-1].mean_lost > 0

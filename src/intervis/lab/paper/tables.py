"""The paper's tables with its numbers beside those measured."""

from collections.abc import Sequence
from math import isnan

import numpy as np

from intervis.lab.paper import printed_values
from intervis.lab.paper.claims import Claim, identity_residuals
from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.experiment import FrameExperiment, agreement
from intervis.lab.paper.interpretations import Reading, ReadingScore
from intervis.lab.paper.temporal_consistency import Steadiness
from intervis.plots.tables import Table

DASH = "–"
"""Where there is no number: nothing to measure, or the paper prints a dash."""

SCORE_HEADINGS = ("away", "mean away", "worst", "std of TPI", "region IoU")

NOTE_READINGS = (
    "Away: mean absolute difference of TPI to Table 2 over all frames and granularities, points."
    " Mean away, worst: mean and greatest difference of the mean over the frames. Std of TPI"
    " (sample) and region IoU: along consecutive frames at tau = 35. Not judged: line 1 of"
    " Algorithm 1 alone."
)

STAGES = ("S1", "S2", "S3", "TIME")


def table_2(result: FrameExperiment) -> Table:
    """N, SP, ARR, TPI, DCP by granularity."""
    names = ("N", "SP", "ARR", "TPI", "DCP")
    headings = ["tau", "n"]
    for name in names:
        unit = "" if name in ("N", "SP") else " %"
        headings += [f"{name}{unit}", f"{name} paper"]
    rows = []
    for tau, printed in printed_values.TABLE_2.items():
        m = result.sweep[tau].measures
        cells = [str(tau), str(m.n)]
        for name in names:
            form = ".0f" if name in ("N", "SP") else ".2f"
            ours = DASH if name == "TPI" and m.N == 0 else format(m[name], form)
            cells += [ours, format(getattr(printed, name), form)]
        rows.append(tuple(cells))
    m = result.ours.measures
    return Table(
        "Table 2. Intervisibility by granularity",
        tuple(headings),
        tuple(rows),
        (
            f"{m.n_fov:,} of {m.n_raw:,} returns are in view here, {printed_values.N_FOV:,} of"
            f" {printed_values.N_RAW:,} in the paper: N and SP differ with them.",
        ),
    )


def identities(result: FrameExperiment) -> Table:
    """N, SP and TPI's ceiling as functions of n and the hull."""
    rows = []
    for tau in printed_values.TAUS:
        step = result.sweep[tau]
        missed = identity_residuals(step)
        ceiling = printed_values.ceiling_of_tpi(step.measures.n - step.copies, step.measures.N)
        rows.append(
            (
                str(tau),
                str(step.measures.n),
                str(step.hull),
                str(step.copies),
                *((DASH,) * 3 if missed is None else (str(value) for value in missed)),
                DASH if missed is None else f"{ceiling:.2f}",
                DASH if missed is None else f"{step.measures.TPI_unique:.2f}",
            )
        )
    return Table(
        "Table 2, what must hold: differences to the formulas, and TPI's ceiling",
        (
            "tau",
            "n",
            "hull h",
            "copies c",
            "n − ⌈n_fov/tau⌉",
            "N − (2(n−c)−2−h)",
            "SP − (N+n−c−1)",
            "greatest TPI %",
            "TPI_unique %",
        ),
        tuple(rows),
        ("TPI_unique is the share of the unique edges that are intervisible.",),
    )


def table_3_one_run(result: FrameExperiment) -> Table:
    """Times of one run."""
    headings, rows = _heading_pairs(STAGES), []
    for tau, printed in printed_values.TABLE_3.items():
        runs = result.timed[tau]
        cells = [str(tau)]
        for stage in STAGES:
            ours = 1e3 * float(runs.column(stage)[0])
            cells += [f"{ours:.3f}", f"{1e3 * getattr(printed, stage):.1f}"]
        before = runs.column("fov")[0] + runs.column("sampling")[0]
        rows.append((*cells, f"{1e3 * before:.3f}"))
    return Table(
        "Table 3, one run, milliseconds",
        (*headings, "before S1"),
        tuple(rows),
        (
            "S1 manifold auxiliary surface, S2 finite elements, S3 spectral analysis and criteria;"
            " TIME is their sum. Field of view and sampling, which the paper does not time, stand"
            " in the last column. Every kernel was compiled before.",
        ),
    )


def table_3_ten_runs(result: FrameExperiment) -> Table:
    """Means and sample standard deviation of ten runs."""
    headings, rows = _heading_pairs(tuple(f"A{stage}" for stage in STAGES)), []
    for tau, printed in printed_values.TABLE_3.items():
        runs = result.timed[tau]
        cells = [str(tau)]
        for stage in STAGES:
            mean = 1e3 * float(runs.column(stage).mean())
            cells += [f"{mean:.3f}", f"{1e3 * getattr(printed, 'A' + stage):.2f}"]
        spread = 1e3 * float(runs.column("TIME").std(ddof=1))
        rows.append((*cells, f"{spread:.3f}", f"{10 * printed.STD:.3f}"))
    return Table(
        "Table 3, mean of ten runs, milliseconds",
        (*headings, "sample std", "STD paper"),
        tuple(rows),
        (
            "A...: mean of ten runs. The sample standard deviation of TIME divides by 9; it is the"
            " paper's STD, which is printed there in hundredths of a second. Its VAR is the same"
            " with a division by 10.",
        ),
    )


def _heading_pairs(names: Sequence[str]) -> tuple[str, ...]:
    return ("tau", *(heading for name in names for heading in (name, f"{name} paper")))


def table_4(result: FrameExperiment) -> Table:
    """The three methods, with the paper's values."""
    rows = []
    results = {
        "global points": (result.everything, result.everything_s),
        "interpolation points": (result.interpolation, result.interpolation_s),
        "ours": (result.ours, result.ours_s),
    }
    for name, (analysis, seconds) in results.items():
        printed = printed_values.TABLE_4[name]
        theirs = (
            f"{printed.nodes}",
            _percent(printed.ARR),
            _percent(printed.TPI),
            _percent(printed.DCP),
            f"{printed.time_s:g}",
        )
        if analysis is None or seconds is None:
            ours = (DASH,) * 5
        else:
            m = analysis.measures
            ours = (
                str(m.n),
                f"{m.ARR:.2f}",
                _percent(m.TPI if m.N else None),
                f"{m.DCP:.2f}",
                f"{seconds:.4f}",
            )
        pairs = [cell for pair in zip(ours, theirs, strict=True) for cell in pair]
        rows.append(
            (f"the paper's method, tau {result.settings.tau}" if name == "ours" else name, *pairs)
        )
    return Table(
        "Table 4. Three methods on one frame, in one run, on one machine",
        (
            "method",
            *(
                heading
                for name in ("nodes", "ARR %", "TPI %", "DCP %", "time s")
                for heading in (name, f"{name.split()[0]} paper")
            ),
        ),
        tuple(rows),
        (
            "Time is S1 + S2 + S3, the middle of several runs (global points: one run). DCP counts"
            " intervisible edges against raw points, so it is negative where a mesh of all returns"
            " has more of them than there are returns.",
            *(() if result.everything else ("Global points was not asked for.",)),
        ),
    )


def table_4_more(result: FrameExperiment) -> Table:
    """What Table 4 does not ask: ratios of time, comparisons made, agreement of the answers."""
    rows = []
    reference = result.everything or result.interpolation
    for name, analysis, seconds in (
        ("global points", result.everything, result.everything_s),
        ("interpolation points", result.interpolation, result.interpolation_s),
        (f"the paper's method, tau {result.settings.tau}", result.ours, result.ours_s),
    ):
        if analysis is None or seconds is None:
            continue
        comparisons = getattr(analysis, "comparisons", 2 * analysis.measures.SP)
        same = agreement(analysis, reference)
        rows.append(
            (
                name,
                f"{seconds / result.ours_s:,.1f}",
                f"{comparisons:,}",
                f"{100 * analysis.node_intervisible.mean():.2f}",
                f"{analysis.measures.TPI_unique:.2f}",
                *(
                    (DASH, DASH)
                    if analysis is reference
                    else (f"{same.share:.1f}", _number(same.correlation))
                ),
            )
        )
    printed = printed_values.TABLE_4
    ratio = [printed[name].time_s / printed["ours"].time_s for name in printed]
    return Table(
        "Table 4, further",
        (
            "method",
            "time, ours = 1",
            "comparisons",
            "nodes seen %",
            "TPI_unique %",
            f"same as {reference.method} %",
            "correlation",
        ),
        tuple(rows),
        (
            f"The paper's ratios of time are {ratio[0]:,.0f} and {ratio[1]:.0f}. The last two"
            " columns compare node by node: share of equal verdicts, and Matthews correlation"
            " (0 by chance, 1 for the same answers).",
        ),
    )


def steadiness_table(steady: Sequence[Steadiness]) -> Table:
    """How much of the region stays from frame to frame, and how the measures scatter."""
    rows = []
    for line in steady:
        rows.append(
            (
                line.method,
                str(len(line.numbers)),
                _number(line.iou),
                _number(line.chance),
                _number(line.beyond_chance),
                *(
                    f"{values.mean():.{digits}f} ± {_spread(values):.{digits}f}"
                    for values, digits in ((line.TPI, 2), (line.seen, 2), (line.area_m2, 0))
                ),
            )
        )
    return Table(
        "Steadiness from frame to frame",
        (
            "method",
            "frames",
            "region IoU",
            "by chance",
            "beyond chance",
            "TPI %",
            "nodes seen %",
            "region m²",
        ),
        tuple(rows),
        (
            "IoU: ground in both regions of two consecutive frames over ground in one of them, on"
            " 0.5 m cells that both meshes cover, laid over each other by the poses; mean over the"
            " pairs. By chance: regions of the same sizes strewn at random. Beyond chance:"
            " (IoU − chance) / (1 − chance). Then mean ± sample standard deviation.",
        ),
    )


def readings_table(scores: Sequence[ReadingScore]) -> Table:
    """Every reading, nearest to Table 2 first."""
    return Table(
        f"{len(scores)} readings against Table 2",
        (*Reading._fields, *SCORE_HEADINGS, *(f"TPI {tau}" for tau in printed_values.TAUS)),
        tuple(
            (*score.reading, *_score_cells(score), *(f"{v:.2f}" for v in score.TPI.mean(axis=0)))
            for score in scores
        ),
        (NOTE_READINGS,),
    )


def choices_table(scores: Sequence[ReadingScore], reading: Reading) -> Table:
    """One reading, and what changing one choice of it at a time does."""
    found = {score.reading: score for score in scores}
    rows = [("as in force", ", ".join(reading), *_score_cells(found[reading]))]
    for name in Reading._fields:
        for score in scores:
            others = score.reading._replace(**{name: getattr(reading, name)})
            if score.reading != reading and others == reading:
                rows.append((name, getattr(score.reading, name), *_score_cells(score)))
    return Table(
        "One choice changed at a time",
        ("choice", "reading", *SCORE_HEADINGS),
        tuple(rows),
        (NOTE_READINGS,),
    )


def best_readings_table(scores: Sequence[ReadingScore], count: int = 12) -> Table:
    """The readings nearest to Table 2 that judge by some criterion."""
    judged = [score for score in scores if score.reading.criterion != "not judged"][:count]
    return Table(
        "Nearest to Table 2 (line 1 to 9 applied)",
        (*Reading._fields, *SCORE_HEADINGS),
        tuple((*score.reading, *_score_cells(score)) for score in judged),
        (NOTE_READINGS,),
    )


def _score_cells(score: ReadingScore) -> tuple[str, ...]:
    return (
        f"{score.away:.2f}",
        f"{score.mean_away:.2f}",
        f"{score.worst:.1f}",
        _number(score.TPI_std),
        _number(score.iou),
    )


def curve_table(points: Sequence[CurvePoint]) -> Table:
    """TPI lost and time against granularity."""
    return Table(
        "What coarser sampling costs",
        ("tau", "nodes", "TPI %", "lost, mean", "lost, most", "frame ms"),
        tuple(
            (
                str(point.tau),
                f"{point.nodes:.0f}",
                f"{point.TPI:.1f}",
                f"{point.mean_lost:.1f}",
                f"{point.most_lost:.1f}",
                f"{point.total_ms:.1f}",
            )
            for point in points
        ),
        (
            "Lost: points of TPI below the best of any finer granularity of the same frame, mean"
            " and most over the frames.",
        ),
    )


def claims_table(claims: Sequence[Claim]) -> Table:
    """The claims, their verdicts and their numbers."""
    return Table(
        "The claims, one by one",
        ("claim", "verdict", "paper", "here"),
        tuple((claim.claim, claim.verdict, claim.paper, claim.ours) for claim in claims),
    )


def verdicts_table(claims: Sequence[Claim]) -> Table:
    """The claims and their verdicts alone, narrow enough for any page."""
    return Table(
        "The claims, one by one",
        ("claim", "verdict"),
        tuple((claim.claim, claim.verdict) for claim in claims),
        (
            '"in the tables" marks what the paper\'s tables show and its text does not say: it'
            " rests on the printed numbers alone.",
        ),
    )


def _spread(values: np.ndarray) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")


def _percent(value: float | None) -> str:
    return DASH if value is None else f"{value:.2f}"


def _number(value: float) -> str:
    return DASH if isnan(value) else f"{value:.2f}"

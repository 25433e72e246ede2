"""The paper's tables: measured values with the printed values beside them."""

from collections.abc import Sequence
from math import isnan

from intervis.lab.paper import printed_values
from intervis.lab.paper.claims import Claim
from intervis.lab.paper.curve import CurvePoint
from intervis.lab.paper.differences import identity_residuals
from intervis.lab.paper.experiment import FrameExperiment, agreement
from intervis.lab.paper.printed_values import GLOBAL_POINTS, INTERPOLATION_POINTS, PROPOSED
from intervis.lab.paper.temporal_consistency import TemporalConsistency, sample_std
from intervis.plots.tables import Table

DASH = "–"
"""Stands where nothing can be measured, and where the paper prints a dash."""

SYMBOLS = (
    "tau: granularity, returns per kernel. n_raw, n_fov: returns of the raw scan, in the field of"
    " view. n: nodes. N: finite elements (triangles). SP: edges of the mesh, the adjacent pairs"
    " that are tested. ARR: share of the raw returns that are not nodes (Eq. 15). TPI: intervisible"
    " edges over 3 N (Eq. 16). DCP: 1 - intervisible edges / n_raw (Eq. 17)."
)
"""The paper's symbols."""

NOTE_RESULTS = (
    '"Not decided": the measurement cannot tell. "In the tables": a finding from the printed'
    " numbers alone, which the paper's text does not state."
)

STAGES = ("S1", "S2", "S3", "TIME")


def table_2(result: FrameExperiment) -> Table:
    """N, SP, ARR, TPI and DCP by granularity."""
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
            here = DASH if name == "TPI" and m.N == 0 else format(m[name], form)
            cells += [here, format(getattr(printed, name), form)]
        rows.append(tuple(cells))
    m = result.proposed.measures
    return Table(
        "Table 2. Intervisibility by granularity",
        tuple(headings),
        tuple(rows),
        (
            SYMBOLS,
            f"{m.n_fov:,} of {m.n_raw:,} returns are in view here, {printed_values.N_FOV:,} of"
            f" {printed_values.N_RAW:,} in the paper; N and SP depend on them.",
        ),
    )


def identities(result: FrameExperiment) -> Table:
    """Differences of n, N and SP to their formulas, and the ceiling of TPI."""
    rows = []
    for tau in printed_values.TAUS:
        point = result.sweep[tau]
        residuals = identity_residuals(point)
        ceiling = printed_values.ceiling_of_tpi(point.measures.n - point.copies, point.measures.N)
        rows.append(
            (
                str(tau),
                str(point.measures.n),
                str(point.hull),
                str(point.copies),
                *((DASH,) * 3 if residuals is None else (str(value) for value in residuals)),
                DASH if residuals is None else f"{ceiling:.2f}",
                DASH if residuals is None else f"{point.measures.TPI_unique:.2f}",
            )
        )
    return Table(
        "Table 2, differences to the formulas of n, N and SP, and the ceiling of TPI",
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
        (
            "h: edges on the hull of the mesh. c: nodes at the position of another node."
            " TPI_unique: intervisible edges over all edges, SP.",
        ),
    )


def table_3_one_run(result: FrameExperiment) -> Table:
    """Times of one run."""
    headings, rows = _heading_pairs(STAGES), []
    for tau, printed in printed_values.TABLE_3.items():
        runs = result.timed[tau]
        cells = [str(tau)]
        for stage in STAGES:
            here = 1e3 * float(runs.column(stage)[0])
            cells += [f"{here:.3f}", f"{1e3 * getattr(printed, stage):.1f}"]
        before = runs.column("fov")[0] + runs.column("sampling")[0]
        rows.append((*cells, f"{1e3 * before:.3f}"))
    return Table(
        "Table 3, one run, milliseconds",
        (*headings, "before S1"),
        tuple(rows),
        (
            "S1: manifold auxiliary surface. S2: finite elements. S3: spectral analysis and"
            " criteria. TIME: their sum. Before S1: field of view and sampling, which the paper"
            " does not time. Compilation is not included.",
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
        rows.append((*cells, f"{1e3 * runs.std_s:.3f}", f"{10 * printed.STD:.3f}"))
    return Table(
        "Table 3, mean of ten runs, milliseconds",
        (*headings, "sample std", "STD paper"),
        tuple(rows),
        (
            "A...: mean of ten runs. Sample std: sample standard deviation of TIME, division by 9."
            " The paper's STD is the same quantity in hundredths of a second; its VAR divides by"
            " 10.",
        ),
    )


def _heading_pairs(names: Sequence[str]) -> tuple[str, ...]:
    return ("tau", *(heading for name in names for heading in (name, f"{name} paper")))


def table_4(result: FrameExperiment) -> Table:
    """The three methods."""
    rows = []
    results = {
        GLOBAL_POINTS: (result.global_lines, result.global_s),
        INTERPOLATION_POINTS: (result.interpolation, result.interpolation_s),
        PROPOSED: (result.proposed, result.proposed_s),
    }
    for name, (analysis, seconds) in results.items():
        printed = printed_values.TABLE_4[name]
        paper = (
            f"{printed.nodes}",
            _percent(printed.ARR),
            _percent(printed.TPI),
            _percent(printed.DCP),
            f"{printed.time_s:g}",
        )
        if analysis is None or seconds is None:
            here = (DASH,) * 5
        else:
            m = analysis.measures
            here = (
                str(m.n),
                f"{m.ARR:.2f}",
                _percent(m.TPI if m.N else None),
                f"{m.DCP:.2f}",
                f"{seconds:.4f}",
            )
        pairs = [cell for pair in zip(here, paper, strict=True) for cell in pair]
        rows.append((f"{name}, tau {result.settings.tau}" if name == PROPOSED else name, *pairs))
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
            "Time: S1 + S2 + S3, median of several runs (global points: one run). DCP is negative"
            " where a mesh has more intervisible edges than there are raw returns.",
            *(() if result.global_lines else ("Global points was not requested.",)),
        ),
    )


def table_4_additions(result: FrameExperiment) -> Table:
    """Additions to Table 4: ratios of time, comparisons made, agreement of the results."""
    rows = []
    reference = result.global_lines or result.interpolation
    for name, analysis, seconds in (
        (GLOBAL_POINTS, result.global_lines, result.global_s),
        (INTERPOLATION_POINTS, result.interpolation, result.interpolation_s),
        (f"{PROPOSED}, tau {result.settings.tau}", result.proposed, result.proposed_s),
    ):
        if analysis is None or seconds is None:
            continue
        comparisons = getattr(analysis, "comparisons", 2 * analysis.measures.SP)
        same = agreement(analysis, reference)
        rows.append(
            (
                name,
                f"{seconds / result.proposed_s:,.1f}",
                f"{comparisons:,}",
                f"{100 * analysis.node_intervisible.mean():.2f}",
                f"{analysis.measures.TPI_unique:.2f}",
                *(
                    (DASH, DASH)
                    if analysis is reference
                    else (f"{same.share:.1f}", number_or_dash(same.correlation))
                ),
            )
        )
    printed = printed_values.TABLE_4
    ratio = [printed[name].time_s / printed[PROPOSED].time_s for name in printed]
    return Table(
        "Table 4, additional measurements",
        (
            "method",
            "relative time",
            "comparisons",
            "intervisible nodes %",
            "TPI_unique %",
            f"same as {reference.method} %",
            "correlation",
        ),
        tuple(rows),
        (
            f"Relative time: {PROPOSED} = 1; in the paper {ratio[0]:,.0f} and {ratio[1]:.0f}. The"
            " last two columns compare node by node: share of equal results, and Matthews"
            " correlation (0 as by chance, 1 for equal results).",
        ),
    )


def consistency_table(consistency: Sequence[TemporalConsistency]) -> Table:
    """Overlap of the regions of consecutive frames, and scatter of the measures."""
    rows = []
    for line in consistency:
        rows.append(
            (
                line.method,
                str(len(line.numbers)),
                number_or_dash(line.iou),
                number_or_dash(line.chance),
                number_or_dash(line.beyond_chance),
                *(
                    f"{values.mean():.{digits}f} ± {sample_std(values):.{digits}f}"
                    for values, digits in (
                        (line.TPI, 2),
                        (line.nodes_intervisible, 2),
                        (line.area_m2, 0),
                    )
                ),
            )
        )
    return Table(
        "Temporal consistency",
        (
            "method",
            "frames",
            "region IoU",
            "by chance",
            "beyond chance",
            "TPI %",
            "intervisible nodes %",
            "region m²",
        ),
        tuple(rows),
        (
            "Region IoU: intersection over union of the regions of two consecutive frames, on 0.5 m"
            " cells of the world's ground that both meshes cover; mean over the pairs. By chance:"
            " IoU expected of random regions of the same sizes. Beyond chance:"
            " (IoU − chance) / (1 − chance). Other columns: mean ± sample standard deviation.",
        ),
    )


def curve_table(points: Sequence[CurvePoint]) -> Table:
    """TPI lost and time by granularity."""
    return Table(
        "TPI lost by coarser sampling",
        ("tau", "nodes", "TPI %", "mean loss", "greatest loss", "frame ms"),
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
            "Loss: points of TPI below the best finer granularity of the same frame; mean and"
            " greatest over the frames.",
        ),
    )


def claims_table(claims: Sequence[Claim]) -> Table:
    """Result, numbers and criterion of each claim."""
    return Table(
        "The paper's claims",
        ("claim", "result", "paper", "here", "criterion"),
        tuple(
            (claim.claim, claim.result, claim.printed, claim.measured, claim.criterion)
            for claim in claims
        ),
        (NOTE_RESULTS,),
    )


def results_table(claims: Sequence[Claim]) -> Table:
    """Result of each claim, narrow enough for a page."""
    return Table(
        "The paper's claims",
        ("claim", "result"),
        tuple((claim.claim, claim.result) for claim in claims),
        (SYMBOLS, NOTE_RESULTS),
    )


def _percent(value: float | None) -> str:
    return DASH if value is None else f"{value:.2f}"


def number_or_dash(value: float) -> str:
    """Two decimals, or a dash for NaN."""
    return DASH if isnan(value) else f"{value:.2f}"

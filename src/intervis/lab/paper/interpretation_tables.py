"""Tables that compare the interpretations of the paper's open choices with its Table 2."""

from collections.abc import Sequence

from intervis.lab.paper import printed_values
from intervis.lab.paper.interpretations import (
    GATE_ONLY,
    Interpretation,
    InterpretationScore,
)
from intervis.lab.paper.tables import number_or_dash
from intervis.plots.tables import Table

SCORE_HEADINGS = (
    "difference",
    "difference of mean",
    "greatest of mean",
    "std of TPI",
    "region IoU",
)

NOTE_SCORES = (
    "Difference: mean absolute difference of TPI to Table 2 over all frames and granularities,"
    " points. Difference of mean, greatest of mean: mean and greatest absolute difference of the"
    " frames' mean TPI to Table 2. Std of TPI (sample) and region IoU: along consecutive frames at"
    " tau = 35. Gate only: line 1 of Algorithm 1, without lines 2 to 9."
)


def interpretations_table(scores: Sequence[InterpretationScore]) -> Table:
    """Every interpretation, nearest to Table 2 first."""
    return Table(
        f"{len(scores)} interpretations against Table 2",
        (*Interpretation._fields, *SCORE_HEADINGS, *(f"TPI {tau}" for tau in printed_values.TAUS)),
        tuple(
            (
                *score.interpretation,
                *_score_cells(score),
                *(f"{v:.2f}" for v in score.TPI.mean(axis=0)),
            )
            for score in scores
        ),
        (NOTE_SCORES,),
    )


def choices_table(scores: Sequence[InterpretationScore], interpretation: Interpretation) -> Table:
    """One interpretation, and those that differ from it in one choice."""
    found = {score.interpretation: score for score in scores}
    rows = [("default", ", ".join(interpretation), *_score_cells(found[interpretation]))]
    for name in Interpretation._fields:
        for score in scores:
            one = score.interpretation
            same = one._replace(**{name: getattr(interpretation, name)}) == interpretation
            if one != interpretation and same:
                rows.append((name, getattr(one, name), *_score_cells(score)))
    return Table(
        "One choice changed at a time",
        ("choice", "interpretation", *SCORE_HEADINGS),
        tuple(rows),
        (NOTE_SCORES,),
    )


def nearest_table(scores: Sequence[InterpretationScore], count: int = 12) -> Table:
    """The interpretations nearest to Table 2 among those with lines 2 to 9 of Algorithm 1."""
    whole = [score for score in scores if score.interpretation.criterion != GATE_ONLY][:count]
    return Table(
        "Nearest to Table 2, lines 1 to 9 of Algorithm 1 applied",
        (*Interpretation._fields, *SCORE_HEADINGS),
        tuple((*score.interpretation, *_score_cells(score)) for score in whole),
        (NOTE_SCORES,),
    )


def _score_cells(score: InterpretationScore) -> tuple[str, ...]:
    return (
        f"{score.difference:.2f}",
        f"{score.difference_of_mean:.2f}",
        f"{score.greatest_of_mean:.1f}",
        number_or_dash(score.TPI_std),
        number_or_dash(score.iou),
    )

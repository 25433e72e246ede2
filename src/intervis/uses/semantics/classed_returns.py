"""Returns with their classes: by labels of points, or by the boxes that hold them."""

from __future__ import annotations  # help() then shows ArrayLike by its name

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from intervis.arguments import mapping_of, object_of, objects_of, shown
from intervis.arrays import (
    BoolArray,
    Float64Array,
    FloatArray,
    IntArray,
    array_of,
    checked_points,
    finite_rows,
    numbers_of,
)
from intervis.drives import Box, Frame
from intervis.drives.point_labels import CLASS_NAMES
from intervis.errors import ArgumentError, DriveError, PointsError, SettingsError
from intervis.sight.box_surface import GROWN_M
from intervis.sight.query_checks import positive_length
from intervis.transform import inverse, transform
from intervis.uses.semantics.parked import is_parked

UNLABELLED = "unlabelled"
"""Class of what has no label and lies in no box."""

PARKED, MOVING = "parked ", "moving-"
"""``parked car`` are the cars that stand still; SemanticKITTI has ``moving-car`` beside ``car``."""

NAMED_WITHIN_M = 1.0
"""A place has the class of the nearest return within this. Of the blockers in a real scan of 64
beams 99 % lie nearer to one (``docs/semantics.md``)."""

LARGEST_LABEL = 2**31


@dataclass(frozen=True, eq=False, repr=False)
class ClassedReturns:
    """Returns, and the class of each.

    Attributes
    ----------
    points : (N, 3) float32 or float64 array
        Metres; in any frame.
    names : tuple of str
        The classes, as the data set names them; the first is ``unlabelled``.
    class_index : (N,) int64 array
        Class of each return: an index into `names`.
    parked : (N,) int8 array
        1 on something that is parked, 0 on something that is not, -1 where that is not known.

    Examples
    --------
    >>> points = np.array([[5.0, 0, 0], [9.0, 0, 0], [9.0, 1, 0]])
    >>> returns = ClassedReturns.of_labels(points, [70, 50, 0])
    >>> returns
    <ClassedReturns: 3 returns; 1 unlabelled, 1 building, 1 vegetation>
    >>> returns.are(["vegetation"]), returns.names_at([[9.2, 0, 0], [7, 0, 0]])
    (array([ True, False, False]), array(['building', 'unlabelled'], dtype='<U10'))
    """

    points: FloatArray
    names: tuple[str, ...]
    class_index: IntArray
    parked: NDArray[np.int8]

    @classmethod
    def of_labels(
        cls, points: ArrayLike, labels: ArrayLike, names: Mapping[int, str] = CLASS_NAMES
    ) -> Self:
        """Returns with a label each, for example those of a network.

        Parameters
        ----------
        points : (N, 3) or (N, 4) float array
            Metres.
        labels : (N,) array of whole numbers
            0: no label.
        names : mapping of int to str
            Names of the classes; by default SemanticKITTI's. A number without a name is named by
            itself: ``class 7``. Where the names hold ``moving-car``, a ``car`` is parked.

        Raises
        ------
        PointsError
            Wrong shape or type, or labels and points differ in number.

        Examples
        --------
        >>> of_network = ClassedReturns.of_labels(np.zeros((2, 3)), [3, 4], {3: "hedge"})
        >>> of_network.names
        ('unlabelled', 'hedge', 'class 4')
        """
        xyz, numbers = checked_points(points), array_of(labels, "labels")
        if numbers.shape != (len(xyz),) or (numbers.size and numbers.dtype.kind not in "iu"):
            raise PointsError(
                f"{len(xyz)} points need as many labels, whole numbers, got {numbers.dtype} of"
                f" shape {numbers.shape}."
            )
        if numbers.size and not 0 <= numbers.min() <= numbers.max() < LARGEST_LABEL:
            raise PointsError(f"labels must be from 0 to {LARGEST_LABEL - 1}.")
        named = mapping_of(names, "names")
        there, index = np.unique(np.append(0, numbers).astype(np.int64), return_inverse=True)
        texts = [UNLABELLED, *(str(named.get(n) or f"class {n}") for n in there[1:].tolist())]
        every = tuple(dict.fromkeys(texts))  # several labels may have one name
        class_of = np.array([every.index(text) for text in texts], np.int64)
        known = set(map(str, named.values()))
        stands = np.array([1 if MOVING + text in known else -1 for text in every], np.int8)
        classes = class_of[index.reshape(-1)[1:]]
        return cls(xyz, every, classes, stands[classes])

    @classmethod
    def in_boxes(
        cls, points: ArrayLike, boxes: Sequence[Box], tracks: Mapping[str, bool] | None = None
    ) -> Self:
        """Returns with the category of the box that holds them.

        Boxes are grown by 0.2 m, but not downwards, where they stand on the ground. The smallest
        box counts where several hold a return.

        Parameters
        ----------
        points : (N, 3) or (N, 4) float array
            In the frame of the boxes, metres.
        boxes : sequence of Box
        tracks : mapping of str to bool, optional
            Whether the object of a track is parked, for boxes without an attribute that says so.
        """
        xyz, every = checked_points(points), objects_of(boxes, Box, "boxes")
        names = (UNLABELLED, *sorted({box.category for box in every} - {UNLABELLED, ""}))
        classes, parked = np.zeros(len(xyz), np.int64), np.full(len(xyz), -1, np.int8)
        for box in sorted(every, key=lambda one: -float(np.prod(one.size_m))):
            inside = _inside(box, xyz)
            stands = is_parked(box, tracks or {})
            classes[inside] = names.index(box.category or UNLABELLED)
            parked[inside] = -1 if stands is None else int(stands)
        return cls(xyz, names, classes, parked)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        counts = np.bincount(self.class_index, minlength=len(self.names)).tolist()
        listed = ", ".join(f"{n:,} {name}" for name, n in zip(self.names, counts, strict=True))
        return f"<ClassedReturns: {len(self):,} returns; {listed}>"

    @property
    def choices(self) -> tuple[str, ...]:
        """What `are` takes: the classes, and ``parked CLASS`` where it is known what is parked."""
        known = np.unique(self.class_index[self.parked >= 0]).tolist()
        return (*self.names, *(PARKED + self.names[index] for index in known))

    def are(self, classes: Iterable[str]) -> BoolArray:
        """(N,) mask of the returns of some classes.

        Parameters
        ----------
        classes : sequence of str
            Names, or ``parked NAME`` for those of a class that stand still.

        Raises
        ------
        SettingsError
            There is no such class; the message lists those that there are.
        """
        wanted = checked_classes(classes)
        check_choices(wanted, self.choices)
        return self.any_of(wanted)

    def any_of(self, classes: Iterable[str]) -> BoolArray:
        """As `are`; classes that these returns do not have are skipped."""
        chosen, choices = np.zeros(len(self), np.bool_), self.choices
        for name in classes:
            if name in self.names:
                chosen |= self.class_index == self.names.index(name)
            elif name in choices:
                index = self.names.index(name.removeprefix(PARKED))
                chosen |= (self.class_index == index) & (self.parked == 1)
        return chosen

    def only(self, mask: ArrayLike) -> Self:
        """The returns of a mask (N,)."""
        chosen = np.asarray(mask, np.bool_)
        return replace(
            self,
            points=self.points[chosen],
            class_index=self.class_index[chosen],
            parked=self.parked[chosen],
        )

    def at(self, points: FloatArray) -> Self:
        """The same returns at other coordinates (N, 3): in another frame."""
        return replace(self, points=points)

    def names_at(self, places: ArrayLike, within_m: float = NAMED_WITHIN_M) -> NDArray[np.str_]:
        """Names of the classes at places: that of the nearest return.

        Parameters
        ----------
        places : (..., 3) array
            In the frame of the points, metres.
        within_m : float
            Without a return so near a place is ``unlabelled``, and so is one that is not finite.

        Returns
        -------
        (...) array of str

        Raises
        ------
        PointsError
            The places are no coordinates.
        SettingsError
            `within_m` is not positive and finite.
        """
        asked, reach_m = numbers_of(places, "places"), positive_length("within_m", within_m)
        if asked.ndim < 1 or asked.shape[-1] != 3:
            raise PointsError(f"places must have the shape (..., 3), got {asked.shape}.")
        flat = asked.reshape(-1, 3)
        index = np.zeros(len(flat), np.int64)
        known = np.flatnonzero(finite_rows(flat))
        rows, tree = self._tree
        if len(known) and len(rows):
            distance_m, nearest = tree.query(flat[known], distance_upper_bound=reach_m)
            near = np.isfinite(distance_m)
            index[known[near]] = self.class_index[rows[nearest[near]]]
        return np.array(self.names)[index].reshape(asked.shape[:-1])

    @cached_property
    def _tree(self) -> tuple[IntArray, cKDTree]:
        """Rows of the returns that are a place, and a tree of these."""
        rows = np.flatnonzero(finite_rows(self.points))
        return rows, cKDTree(self.points[rows])


def classed_returns(frame: Frame, tracks: Mapping[str, bool] | None = None) -> ClassedReturns:
    """The returns of a frame with their classes: by the labels of the points, or by its boxes.

    Parameters
    ----------
    frame : Frame
        With labels (`Frame.point_classes`) or `boxes`; the labels count where it has both.
    tracks : mapping of str to bool, optional
        See `ClassedReturns.in_boxes`.

    Returns
    -------
    ClassedReturns
        In the order of `frame.points`, in the scanner's frame.

    Raises
    ------
    DriveError
        The frame has neither labels nor boxes, or these cannot be read.
    """
    found = returns_with_classes(object_of(frame, Frame, "frame"), tracks)
    if found is None:
        raise DriveError(no_classes(frame))
    return found


def returns_with_classes(
    frame: Frame, tracks: Mapping[str, bool] | None = None
) -> ClassedReturns | None:
    """As `classed_returns`; None where the frame has neither labels nor boxes."""
    labels = frame.point_classes
    if labels is not None:
        return ClassedReturns.of_labels(frame.points, labels)
    boxes = frame.boxes
    return ClassedReturns.in_boxes(frame.points, boxes, tracks) if boxes else None


def no_classes(frame: Frame) -> str:
    """The sentence for a frame whose returns have no classes."""
    return (
        f"frame {frame.number} has neither labels of its points nor boxes, so that nothing says"
        " what is what: choose a labelled frame."
    )


def joined(parts: Sequence[ClassedReturns]) -> ClassedReturns:
    """The returns of several, in one frame; at least one."""
    names = (UNLABELLED, *sorted({name for part in parts for name in part.names} - {UNLABELLED}))
    place = {name: index for index, name in enumerate(names)}
    maps = [np.array([place[name] for name in part.names]) for part in parts]
    index = [of_part[part.class_index] for of_part, part in zip(maps, parts, strict=True)]
    return ClassedReturns(
        np.concatenate([part.points for part in parts]),
        names,
        np.concatenate(index).astype(np.int64),
        np.concatenate([part.parked for part in parts]),
    )


def checked_classes(classes: Iterable[str]) -> tuple[str, ...]:
    """Names of classes; one text is refused, for it would be read letter by letter.

    Raises
    ------
    ArgumentError
        They are no list of texts.
    """
    if isinstance(classes, str):
        raise ArgumentError(f"classes must be a list of names, as [{shown(classes)}].")
    return tuple(objects_of(classes, str, "classes"))


def check_choices(wanted: Iterable[str], choices: Iterable[str]) -> None:
    """Check that there are such classes.

    Raises
    ------
    SettingsError
        There is none of a name; the message lists those that there are.
    """
    there = list(dict.fromkeys(choices))
    for name in wanted:
        if name in there:
            continue
        listed = ", ".join(sorted(there))
        if name.removeprefix(PARKED) in there:
            raise SettingsError(
                f"nothing says which {shown(name.removeprefix(PARKED))} is parked: that needs an"
                " attribute of the box, or its track in frames with poses and times; choose from"
                f" {listed}."
            )
        raise SettingsError(f"there is no class {shown(name)}: choose from {listed}.")


def _inside(box: Box, points: FloatArray) -> IntArray:
    """Rows of the points (N, 3) in a box that is grown to all sides but down."""
    half: Float64Array = 0.5 * np.asarray(box.size_m) + GROWN_M
    with np.errstate(invalid="ignore", over="ignore"):
        offset = points - box.velo_from_box[:3, 3]
        reach_m = float(np.linalg.norm(half))
        near = np.flatnonzero((np.abs(offset) <= reach_m).all(axis=1))
    local = transform(inverse(box.velo_from_box), points[near])
    inside = (np.abs(local) <= half).all(axis=1) & (local[:, 2] >= GROWN_M - half[2])
    rows: IntArray = near[inside]
    return rows

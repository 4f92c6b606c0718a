"""What a detector of eyes gives, whichever it is: lid contours as the tracker's points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.shapes import Points
from stimuli_builder.video import Picture

UPPER_SHARES = (0.2, 0.4, 0.6, 0.8)
LOWER_SHARES = (0.25, 0.5, 0.75)


@dataclass(frozen=True, eq=False)
class Detection:
    """The eyes of one face in one picture.

    Attributes
    ----------
    points : float64 array
        (18, 2) or, for one eye, (9, 2) in pixels, in the order of label files.
    iris : float64 array (eyes, 5, 2)
        Centre and four points of each iris's edge.
    box : float64 array (4,)
        Least x and y, then greatest x and y, of the face; of the eye in a close-up.
    spreads : tuple of float
        Of each eye, how steadily it is read: its `contour_spread` and, for a face, half of its mirror share,
        added in quadrature.
    mirror_shares : tuple of float
        Of each eye of a face, mean distance of its points as read in the picture from those of its mirror
        image, as part of the eye's width; infinite where the mirror image does not show the face.
    surroundings : float32 array (eyes, cells) or None
        What lies around each eye, see `covers.surroundings_of`; None where nobody looked.
    """

    points: Points
    iris: Points
    box: Points
    spreads: tuple[float, ...]
    mirror_shares: tuple[float, ...] = ()
    surroundings: NDArray[np.float32] | None = None

    @property
    def area_px2(self) -> float:
        """Area of the box in square pixels."""
        return float(np.prod(self.box[2:] - self.box[:2]))

    def moved(self, x: float, y: float) -> Self:
        """The detection, so many pixels to the right and down."""
        by = np.array([x, y])
        return replace(self, points=self.points + by, iris=self.iris + by, box=self.box + np.tile(by, 2))


class LidDetector(Protocol):
    """Finds the eyes of faces in one picture, without a memory of the one before."""

    eyes: int

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eyes of each face in an RGB picture (h, w, 3), the largest first."""


def eye_points(upper: Points, lower: Points) -> Points:
    """Nine points of an eye from its contours.

    Parameters
    ----------
    upper, lower : float64 array (k, 2)
        Contours from the outer canthus to the inner, and from the inner to the outer.
    """
    return np.concatenate(
        [upper[:1], along(upper, UPPER_SHARES), upper[-1:], along(lower, LOWER_SHARES)], axis=0
    )


def contour_spread(contours: Points, width: float) -> float:
    """How far an eye's contour moves with the region that it is read in, as part of the eye's width.

    An eye, open or shut, stays where it is. Where there is none a network draws one all the same, in the
    middle of whatever region it is shown.

    Parameters
    ----------
    contours : float64 array (views, k, 2)
        The same points as read in several regions, in pixels of the picture.
    width : float
        Of the eye, in pixels.

    Returns
    -------
    float
        Root mean square distance of the points from their means.
    """
    away = contours - contours.mean(0)
    return float(np.sqrt((away**2).sum(-1).mean()) / width)


def along(curve: Points, shares: Sequence[float]) -> Points:
    """Points of a polyline (k, 2) at shares of its length."""
    steps = np.hypot(*np.diff(curve, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    targets = np.array(shares) * along[-1]
    return np.stack([np.interp(targets, along, curve[:, axis]) for axis in (0, 1)], axis=1)

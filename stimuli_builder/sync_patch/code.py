"""What the nine fields of the patch say.

Three by three fields, row by row. The one in the middle is white for odd frames: a photodiode over it sees
each frame's change. The other eight are the frame's number as a Gray code, lowest bit first: from one frame
to the next one of them changes, so that a picture which mixes two frames reads as one of them or as neither.
All white: no frame.
"""

import numpy as np
from numpy.typing import NDArray

FIELDS = 9
PARITY_FIELD = 4
NUMBERS = 256
"""Numbers come again after this many frames."""
NO_FRAME, UNREADABLE = -1, -2
WHITE_ABOVE, BLACK_BELOW = 0.62, 0.38

CODE_FIELDS = np.array([field for field in range(FIELDS) if field != PARITY_FIELD])


def fields(number: int) -> NDArray[np.bool_]:
    """White (True) and black fields of a frame, row by row.

    Parameters
    ----------
    number : int
        The frame's number from 0.

    Returns
    -------
    bool array (9,)
    """
    number %= NUMBERS
    code = number ^ (number >> 1)
    white = np.empty(FIELDS, np.bool_)
    white[CODE_FIELDS] = [(code >> bit) & 1 == 1 for bit in range(len(CODE_FIELDS))]
    white[PARITY_FIELD] = number % 2 == 1
    return white


def read(brightness: NDArray[np.float64]) -> NDArray[np.int64]:
    """The number that each picture shows.

    Parameters
    ----------
    brightness : float array (pictures, 9)
        Of each field, 0 black to 1 white.

    Returns
    -------
    int array (pictures,)
        0 to 255, NO_FRAME where all fields are white, UNREADABLE where the patch was changing.
    """
    white = brightness > WHITE_ABOVE
    clear = (white | (brightness < BLACK_BELOW)).all(axis=1)
    numbers = np.array([_NUMBER_OF.get(row.tobytes(), UNREADABLE) for row in white], np.int64)
    return np.where(clear, numbers, UNREADABLE)


_NUMBER_OF = {fields(number).tobytes(): number for number in range(NUMBERS)}
_NUMBER_OF[np.ones(FIELDS, np.bool_).tobytes()] = NO_FRAME

"""The elevation model of the Jacksboro fault, Tennessee, that matplotlib ships."""

import numpy as np
from numpy.typing import NDArray

from infoplan.backend import load_matplotlib

UNIT = "m"


def jacksboro() -> NDArray[np.float64]:
    """Elevations around the Jacksboro fault: ridges, a long straight scarp, a valley floor.

    All nodes as shipped, 3 arc seconds apart, about 30 km by 32 km.

    Returns
    -------
    ndarray, shape (344, 403)
        Metres; row 0 is the south, column 0 the west.
    """
    load_matplotlib()
    from matplotlib.cbook import get_sample_data

    with np.load(get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as content:
        # Stored like an image, the north first.
        return content["elevation"][::-1].astype(np.float64)

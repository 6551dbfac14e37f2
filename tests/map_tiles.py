"""Ways to compute a tile that workers can import: they do not come back from them."""

import os
import signal

from reflectance_fit import mapping


def dies_at_the_second_tile(job, tile):
    if tile.column > 0 and tile.row == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    mapping.compute_tile(job, tile)


def dies(_job, _tile):
    os.kill(os.getpid(), signal.SIGKILL)

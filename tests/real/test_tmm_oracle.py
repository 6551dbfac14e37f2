"""Fresnel amplitudes and powers of the third-party package tmm 0.2 for eleven materials.

tmm's signs (Byrnes, arXiv:1603.02720) are ours, so nothing is converted: a
sign convention that drifts fails here with a named material and angle.
"""

import csv

import numpy as np

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.fresnel import amplitudes, reflectances


def test_every_row_is_reproduced(data):
    with (data / "oracles" / "fresnel_tmm_oracle.csv").open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len({row["material"] for row in rows}) == 11
    column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "material"}
    cosine, _ = cos_sin_deg(column["theta_deg"])
    r_s, r_p = amplitudes(cosine, column["n"], column["k"])
    power = reflectances(cosine, column["n"], column["k"])
    # The file prints 15 digits of numbers of order 1.
    ours = {
        "Rs": power.s,
        "Rp": power.p,
        "rs_re": r_s.real,
        "rs_im": r_s.imag,
        "rp_re": r_p.real,
        "rp_im": r_p.imag,
    }
    for name, values in ours.items():
        np.testing.assert_allclose(values, column[name], rtol=0, atol=1e-12, err_msg=name)

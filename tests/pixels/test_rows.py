"""What frames read of a surface, held to the Mueller chain of the readable physics."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.kernels import interface

ANGLE = st.floats(-180.0, 180.0)


@given(
    eta=st.floats(0.1, 5.0),
    k=st.floats(0.0, 8.0),
    theta=st.floats(0.0, 89.0),
    s=ANGLE,
    retarder=ANGLE | st.just(np.nan),
    light=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    diattenuation=st.floats(0.5, 1.0),
    turns=st.booleans(),
)
def test_responses_are_the_mueller_chain(
    make, signals, eta, k, theta, s, retarder, light, diattenuation, turns
):
    rows = make(
        [theta],
        2,
        1.5,
        0.0,
        analyzers=(0.0, 33.0, 100.0, np.nan),
        light=(1.0, *light),
        retarder_deg=retarder,
        diattenuation=diattenuation,
        s_deg=[s, s + 20.0] if turns else s,
    )
    assert rows.turns == turns
    t = float(rows.theta[0, 0])
    reflected = np.array(interface(np.cos(t), np.sin(t), eta, k))
    axes = np.stack([np.ones_like(rows.cos_2s[0]), rows.cos_2s[0], rows.sin_2s[0]]).astype(float)
    found = np.einsum("mqx,q,xn->mn", rows.responses(), reflected, axes)
    np.testing.assert_allclose(np.broadcast_to(found, (4, 2)), signals(rows, eta, k), atol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"values": np.ones((4, 2))}, "float32"),
        ({"variance": np.ones((4, 3), dtype=np.float32)}, "variance has the shape"),
        ({"gain": np.full(4, -2)}, "gain must number"),
        ({"view": np.ones(4, dtype=np.int64)}, "view must number"),
        ({"analyzer": np.ones(3)}, "one number a frame"),
        ({"light": np.ones((4, 3))}, "Stokes"),
        ({"theta": np.ones((1, 3), dtype=np.float32)}, "theta must have the shape"),
        ({"cos_2s": np.ones((1, 2), dtype=np.float32)}, "equal shapes"),
    ],
)
def test_what_does_not_fit_is_said(change, said, make):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(make([50.0], 2, 1.5, 0.0), **change)

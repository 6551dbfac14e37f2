"""Designs: what they would measure, and that none found by chance is much better than the one searched for."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference.design import GRID_DEG, KINDS, Design, Subject, best, common, planned, sigmas
from reflectance_fit.inference.fisher import information
from reflectance_fit.materials import library
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import polarizer, reflection, retarder
from reflectance_fit.planning import NUISANCE_SIGMAS

KIND = {kind.name: kind for kind in KINDS}


def subject_of(material, priors, share=0.001, nuisances=NUISANCE_SIGMAS):
    eta, k = map(float, library.get(material).absolute_index(550.0))
    k = k if k > 1e-3 else 0.0
    return Subject(eta, k, AIR_INDEX, lambda v: share * np.maximum(v, 1e-3), priors, nuisances)


def worst(design, subject):
    """The larger relative sd of eta and k (eta for a dielectric), by the whole design's own information."""
    rows = planned(design, subject)
    names = ("eta", "k") if subject.k > 0 else ("eta",)
    covariance = information(
        rows,
        subject.eta,
        subject.k,
        exterior_ior=subject.exterior_ior,
        priors={name: subject.priors[name] for name in names},
        nuisances=sigmas(subject, float(rows.value.max())),
    ).covariance(*names)
    return np.max(np.sqrt(np.diag(covariance)) / [1.0, subject.k][: len(names)])


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_planned_rows_are_the_readable_physics(priors, kind):
    subject = subject_of("Al", priors)
    rows = planned(Design(kind, (40.0, 75.0)), subject)
    assert len(rows) == 2 * kind.frames
    for i, angle in enumerate((40.0, 75.0)):
        mirror = reflection(
            *amplitudes(np.cos(np.radians(angle)), subject.eta / AIR_INDEX, subject.k / AIR_INDEX)
        )
        for j, (analyzer, plate) in enumerate(kind.settings):
            optics = polarizer(np.radians(analyzer))
            if plate is not None:
                optics = optics @ retarder(np.radians(plate), np.pi / 2)
            row = i * kind.frames + j
            assert rows.value[row] == pytest.approx((optics @ mirror @ kind.light)[0], rel=1e-10)
            assert rows.theta_deg[row] == angle
    assert len(set(rows.gain_group)) == 2


@pytest.mark.parametrize("material", ["Al", "Cr"])
@pytest.mark.parametrize("share", [0.01, 0.001])
@pytest.mark.parametrize(
    "nuisances", [{}, {"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0}], ids=["exact", "rig"]
)
def test_a_metal_s_worst_sigma_falls_five_times(priors, material, share, nuisances):
    """Same light, settings and number of photographs as 30, 45 and 60 degrees, an analyzer and nothing else."""
    subject = subject_of(material, priors, share, nuisances)
    found = best(KIND["s and p"], 12, subject, with_k=True)
    assert found.frames == common(found.kind, 12).frames == 12
    assert worst(common(found.kind, 12), subject) / worst(found, subject) >= 5


@pytest.mark.parametrize("material", ["Al", "Cr", "N-BK7"])
@pytest.mark.parametrize("name", ["s and p", "lamp at 45, four axes", "lamp at 45, plate, six frames"])
def test_no_random_angles_are_better(priors, material, name):
    subject = subject_of(material, priors)
    found = best(KIND[name], 12, subject, with_k=True)
    generator = np.random.default_rng(0)
    value = worst(found, subject)
    for _ in range(40):
        angles = np.sort(generator.choice(GRID_DEG, size=len(found.angles_deg)))
        # Exchange ends in a local optimum; one that chance beats by a tenth would be a poor one.
        assert worst(Design(found.kind, tuple(angles)), subject) > 0.9 * value
    assert found == best(KIND[name], 12, subject, with_k=True)


def test_eta_alone_asks_for_other_angles(priors):
    subject = subject_of("Al", priors)
    for_eta = best(KIND["s and p"], 12, subject, with_k=False)
    rows = planned(for_eta, subject)
    priors_of = {
        "exterior_ior": AIR_INDEX,
        "priors": priors,
        "nuisances": sigmas(subject, float(rows.value.max())),
    }
    alone = information(rows, subject.eta, subject.k, **priors_of).covariance("eta")[0, 0]
    both = planned(best(KIND["s and p"], 12, subject, with_k=True), subject)
    assert alone <= information(both, subject.eta, subject.k, **priors_of).covariance("eta")[0, 0] * 1.001


def test_photographs_that_are_left_over_stay_untaken(priors):
    design = common(KIND["lamp at 45, three axes"], 11)
    assert (design.angles_deg, design.frames) == ((30.0, 45.0, 60.0), 9)
    assert best(KIND["lamp at 45, three axes"], 11, subject_of("Al", priors), with_k=True).frames == 9

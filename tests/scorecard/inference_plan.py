"""What planning gains: the worst relative sd of a metal's eta and k, planned against 30, 45 and 60 degrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from card import Figure, Table

from reflectance_fit.inference.design import Design, Subject, common, planned, sigmas
from reflectance_fit.inference.fisher import information
from reflectance_fit.planning import plan, recommended

METALS = ("Al", "Cr")
NOISE, FRAMES, LEAST = 0.01, 12, 5.0


def plan_figures() -> Iterator[Figure | Table]:
    """Of the design that ``plan`` recommends, and of every equipment's best."""
    rows = []
    for material in METALS:
        found = plan(material=material, noise=NOISE, frames=FRAMES)
        usual = next(o.design for o in found.usual if o.design.kind.name == "s and p")
        assert usual == common(usual.kind, FRAMES)
        rig = found.subject.nuisances
        gains = {o.design.kind.name: _gain(usual, o.design, found.subject, rig) for o in found.best}
        chosen = recommended(found).design.kind.name
        yield Figure.judged(
            f"plan for {material}: worst sigma of s and p at (30, 45, 60) deg over that of the recommended design",
            f"{gains[chosen]:.1f} ({chosen}, {FRAMES} photographs each, all nuisances of a rig)",
            f"{LEAST:g} at least",
            gains[chosen] >= LEAST,
        )
        alike = next(o.design for o in found.best if o.design.kind.equipment == usual.kind.equipment)
        exact = _gain(usual, alike, found.subject, {})
        rows += [(material, name, f"{gain:.1f}") for name, gain in gains.items()]
        rows.append((material, f"{alike.kind.name}, nothing but noise", f"{exact:.1f}"))
    yield Table(
        "Plans against s and p at (30, 45, 60) deg",
        ("material", "design", "worst sigma, times less"),
        tuple(rows),
    )


def _gain(usual: Design, design: Design, subject: Subject, nuisances: Mapping[str, float]) -> float:
    return _worst(usual, subject, nuisances) / _worst(design, subject, nuisances)


def _worst(design: Design, subject: Subject, nuisances: Mapping[str, float]) -> float:
    rows = planned(design, subject)
    names = ("eta", "k")
    largest = float(rows.value.max())
    rig = {name: sigma for name, sigma in sigmas(subject, largest).items() if name in nuisances}
    covariance = information(
        rows,
        subject.eta,
        subject.k,
        exterior_ior=subject.exterior_ior,
        priors={name: subject.priors[name] for name in names},
        nuisances=rig,
    ).covariance(*names)
    # The coordinate of eta is its logarithm.
    return float(np.max(np.sqrt(np.diag(covariance)) / [1.0, subject.k]))

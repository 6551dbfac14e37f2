"""report.yaml as types: what is written is what this says, and ``schema report`` prints it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Status = Literal["identified", "upper_limit", "not_identified", "multimodal", "fixed"]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)


class Sample(_Part):
    name: str
    note: str | None = None


class Estimate(_Part):
    """A posterior: median, sd, 68 and 95 % intervals; null where nothing honest can be said."""

    median: float | None
    sd: float | None
    ci68: Pair | None
    ci95: Pair | None
    status: Status
    modes: list[float] | None = Field(None, description="median of each mode, where multimodal")


class BrewsterEstimate(Estimate):
    kind: Literal["brewster", "pseudo_brewster"]


class Candidate(_Part):
    name: str
    nuisances: list[str] = []
    noise: Literal["normal", "student_t"] = "normal"
    parameters: int
    chi2: float = Field(description="of student_t, like dof, without the outliers")
    dof: int
    bic: float
    elpd_loo: float | None = Field(None, description="of the chosen one and its rival")


class LeaveOneOut(_Part):
    """How much better the chosen model foretells rows left out than its rival."""

    rival: str
    elpd_difference: float
    se: float
    pareto_k: float = Field(description="tail of the weights; above 0.7 the figures are not to be trusted")
    agrees: bool = Field(description="false where the rival is clearly better")


class Nuisance(_Part):
    median: float
    sd: float


class Dispersion(_Part):
    """eta = cauchy_a + cauchy_b_um2 / wavelength^2, the wavelength in um, for all channels of the fit."""

    cauchy_a: Nuisance
    cauchy_b_um2: Nuisance


class ModelChoice(_Part):
    name: str
    noise: Literal["normal", "student_t"] = "normal"
    chosen_because: str
    loo: LeaveOneOut | None = Field(None, description="null where there was no rival worth it")
    candidates: list[Candidate]
    dispersion: Dispersion | None = Field(None, description="absent where every channel has its own eta")


class FitQuality(_Part):
    optimizer: str
    chi2: float
    dof: int
    reduced_chi2: float | None
    p_value: float | None = Field(description="null where sigma was estimated from the residuals")
    nuisances: dict[str, Nuisance]
    gains: dict[str, float]
    estimated_sigma: dict[str, float]
    nan_evaluations: int


class PosteriorQuality(_Part):
    """Of the chosen model; what a method has none of is null."""

    method: Literal["emcee", "importance", "laplace"]
    ensembles: int
    draws: int
    steps: int | None
    burn_in: int | None
    ess_min: float
    rhat_nested_max: float | None
    acceptance: float | None
    autocorrelation_steps: float | None
    pareto_k: float | None = Field(
        None, description="tail of the importance weights; above 0.7 emcee is used"
    )


class FitReport(_Part):
    channels: list[str]
    model: ModelChoice
    fit: FitQuality
    posterior: PosteriorQuality


class Spread(_Part):
    """Of a posterior: what a figure is when the material is one of its draws."""

    median: float
    sd: float
    ci68: Pair
    ci95: Pair


class ApproximationError(_Part):
    """An approximation minus exact Fresnel for unpolarized light, over 0 to 90 deg."""

    name: str
    max_abs_error: float
    at_deg: float
    max_rel_error: float | None
    rms_error: float
    albedo_error: float | None
    max_abs_error_posterior: Spread | None = Field(None, description="absent where there are no draws")
    ns_per_eval: float | None = Field(None, description="measured in this run; absent with --no-timings")


class SchlickError(_Part):
    """Schlick's own figures, then every approximation's."""

    max_abs_error: float
    at_deg: float
    max_rel_error: float | None
    rms_error: float
    albedo_error: float | None
    max_abs_error_posterior: Spread | None = Field(None, description="absent where there are no draws")
    approximations: list[ApproximationError]


class Literature(_Part):
    """The built-in table that the sample's name points to; values relative to vacuum."""

    nearest: str
    eta: float
    k: float | None
    z: float | None = Field(description="(fitted - tabulated eta) / sd")
    z_k: float | None = Field(None, description="(fitted - tabulated k) / sd; null where either is unknown")
    source: str


class Sensitivity(_Part):
    """How far the results move where one thing that was not fitted is off by ``amount``."""

    disturbance: Literal[
        "angle_offset",
        "extinction_ratio",
        "diffuse",
        "black_level",
        "source_polarization",
        "analyzer_offset",
    ]
    amount: float
    unit: str
    eta: float = Field(description="change of eta")
    k: float = Field(description="change of k; 0 where k was not fitted")
    brewster_deg: float = Field(description="change of the Brewster angle, deg")


class Health(_Part):
    """An identity that holds for every material."""

    check: Literal["rp_equals_rs_squared"]
    theta_deg: float
    value: float = Field(description="R_p; for signals the gain that they give by themselves")
    expected: float = Field(description="R_s^2; for signals the fitted gain")
    z: float = Field(description="how far R_p is from R_s^2, in standard deviations")


class Channel(_Part):
    channel: str
    fit: int = Field(description="index into fits")
    wavelength_nm: float
    eta: Estimate
    k: Estimate
    brewster_deg: BrewsterEstimate
    second_brewster_deg: Estimate | None = None
    principal_angle_deg: Estimate | None = None
    r0: Estimate
    schlick: SchlickError | None = Field(description="null where eta is not identified")
    literature: Literature | None = None
    sensitivity: list[Sensitivity] = Field(default=[], description="largest first; of what was not fitted")
    health: list[Health] = Field(default=[], description="near 45 deg only")


class Effort(_Part):
    fresnel: str
    model: str
    posterior: str
    seconds: dict[str, float] | None = None


class Warning(_Part):
    """What a reader of the figures must know about them."""

    code: Literal[
        "WRONG_MODEL",
        "ANGLE_RANGE",
        "SATURATED",
        "DARK_OFFSET",
        "FILM_SUSPECTED",
        "WIDE_BAND",
        "NOT_CONVERGED",
        "SIGMA_ESTIMATED",
        "LITERATURE_DISAGREES",
        "NO_HASHES",
        "TOLERANCE_FLOOR",
        "ROWS_IGNORED",
        "MASKED",
        "IMBALANCE",
        "NOT_LINEAR",
    ]
    channel: str | None
    message: str


class Input(_Part):
    file: str
    sha256: str


class Provenance(_Part):
    version: str
    seed: int
    inputs: list[Input]
    packages: dict[str, str]


class Report(_Part):
    """What one run found: schema reflectance_fit/material-report/1."""

    schema_: Literal["reflectance_fit/material-report/1"] = Field(
        default="reflectance_fit/material-report/1", alias="schema"
    )
    sample: Sample
    exterior_ior: float = Field(gt=0)
    fits: list[FitReport]
    channels: list[Channel]
    priors: dict[str, Any]
    effort: Effort
    warnings: list[Warning]
    provenance: Provenance
    conventions: str = "docs/conventions.md"

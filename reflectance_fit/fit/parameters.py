from reflectance_fit.priors import *  # noqa: F403 temporary

from reflectance_fit.result import *  # noqa: F403 temporary

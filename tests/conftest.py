"""One hypothesis profile: no deadline (kernels compile in the first call), the same examples every run."""

from hypothesis import settings

settings.register_profile("reproducible", deadline=None, derandomize=True)
settings.load_profile("reproducible")

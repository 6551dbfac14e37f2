"""From measured reflection to refractive index, extinction and Brewster angle."""

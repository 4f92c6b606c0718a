"""Who sees what and in which order: pure functions of declaration, seed and slot."""

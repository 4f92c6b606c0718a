"""From speech to a whole performance of the eyelids."""

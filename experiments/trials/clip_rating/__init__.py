"""One clip after another, each rated on a scale."""

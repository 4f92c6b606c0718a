"""A capsule: one zip with a study's data, declaration, clips and report, each file known by its hash."""

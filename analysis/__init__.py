"""The statistics: within-subject ANOVA, pairs, tables, figures and reports."""

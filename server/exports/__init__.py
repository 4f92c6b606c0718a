"""Downloads: exports, capsules, reports and sealed plans."""

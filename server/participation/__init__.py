"""The participant's side: runs, trials, views, ratings, evidence and series."""

"""The web server: studies, participants, trials, monitor and export."""

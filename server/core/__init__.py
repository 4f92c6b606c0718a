"""What every part of the server rests on: settings, database, locks, limits, errors."""

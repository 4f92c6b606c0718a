"""What was counted of each run, kept with each rating: heat map, plays, times, cell sums, answers."""

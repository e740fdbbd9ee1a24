"""What to run, and what to run next: discretisations, load steps, costs, and the records that decide."""

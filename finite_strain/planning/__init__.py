"""Planning of a run and of its next step: discretisations, load steps, costs, and the records for decisions."""

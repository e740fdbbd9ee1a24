"""The study ``stability``: hard cases times models, each with a right answer and its check, or a named refusal."""

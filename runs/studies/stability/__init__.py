"""The study ``stability``: hard cases times models, each with a checked answer or a refusal that gives its reason."""

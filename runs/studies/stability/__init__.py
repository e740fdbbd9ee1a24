"""The study ``stability``: hard cases with several models, each with a checked answer or a refusal with its reason."""

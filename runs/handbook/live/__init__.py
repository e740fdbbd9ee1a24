"""The live page: its table, and the JavaScript that computes with it."""

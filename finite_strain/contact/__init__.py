"""Contact of the layer with rigid indenters: its energy."""

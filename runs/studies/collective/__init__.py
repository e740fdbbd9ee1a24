"""Study: when a layer of many balls gathers, orders, or stays as it is."""

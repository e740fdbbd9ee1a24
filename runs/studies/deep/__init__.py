"""The study ``deep``: how deep balls can be pressed in, what ends the load path, and T up to there."""

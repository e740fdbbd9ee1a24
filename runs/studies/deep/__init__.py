"""The study ``deep``: how deep balls can be pressed in, what ends a load path, and what T does there."""

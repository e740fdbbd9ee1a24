"""The study ``experiments``: the source's balls that gather and scatter, beside what it reports of them."""

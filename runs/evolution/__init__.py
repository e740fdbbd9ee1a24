r"""Balls that drift under their mutual forces while a plate slides back and forth above them.

The law. While a ball slides (or rolls) along the main motion, friction f Q opposes its *total* relative velocity, so a
small in-plane force T has no threshold to overcome: it turns the direction of sliding by the angle T/(f Q), and the
ball drifts along T. Quasi-statically, per unit of sliding path s,

    dx_i/ds = T_i / (f Q_i),     s = 4 x amplitude per cycle.

With sigma = s/f as the independent variable f drops out of the equations: it changes only the time scale.
f is an *effective* coefficient of friction or rolling; the source gives none.

The direction of the main motion does not enter. A force across the motion moves a sliding ball as above; for a
force along the motion, Coulomb's law alone gives no drift to first order (friction is already saturated in that
direction), and the resistance of a rolling ball would differ along and across. The source states that the rate does not
depend on the direction [Materials 2021, 14(19), 5689, sec. 1], and gives no law for the difference observed in section
2.1; so the law here is isotropic, and ``direction`` only sets the arrow in the pictures.

Balls are hard. They rest on one level and touch when their axes are 2 sqrt(R_i R_j) apart (see
`runs.evolution.hard_balls`); contacts push and never pull. T does not move a ball without load (Q = 0); pushes do.

Optional effects: with ``[rolling_resistance]`` only the force in excess of a share of its load moves a ball
(`runs.evolution.motion`); with ``[periodic]`` the balls are in a periodic cell (`runs.evolution.pair_list`).
"""

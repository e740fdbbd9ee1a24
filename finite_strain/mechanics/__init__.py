"""What the solid is: strain from displacement, the energy of a law, and what a change of volume costs."""

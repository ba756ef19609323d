"""A bench for the soft finger: an independent finite element model of the silicone, its cables, sensors and camera."""

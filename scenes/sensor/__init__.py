"""The simulated speckle sensor: a coherent sum over scattering paths in a layer of silicone.

docs/sensor.md goes through the files one by one. Lengths are in metres, angles in radians,
temperatures in kelvin. Nothing is imported here: a scene loads only the parts it is made of.
"""

"""The simulated speckle sensor: a coherent sum over scattering paths in a layer of silicone.

One idea a file, each to be read on its own:

=================  ================================================================================
``elastomer``      displacement of a bonded incompressible layer under a Hertz pressure
``paths``          scattering paths from fibre to camera and their phases
``environment``    temperature within a session
``camera``         pupil, illumination, photons, eight bits
``sensor``         the calibrated sensor: the four above with one seed
``contact``        who touches where, how deep and with what repeatability
``texture``        a grainy surface instead of a smooth one (loaded by ``scene=tactile`` only)
``scene``          labels, sessions and samples: the frames that a classifier sees
=================  ================================================================================

Lengths are in metres, angles in radians, temperatures in kelvin. Nothing is imported here: a scene
loads only the parts it is made of.
"""

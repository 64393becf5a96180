# SPDX-License-Identifier: Apache-2.0
"""The base class of methods in Python."""


class Method:
    """Base of a method of haptic rendering written in Python.

    Give an object of your class to `Renderer`, `trace` or `bench.pop`. A method in Python is for
    trying ideas: it takes microseconds to hundreds of them a tick, and allocates.
    """

    def frame(self, cloud, stamp):
        """A new frame: `cloud.near(centre, radius)` gives its points until the next one.

        stamp: [s] when it was captured, on the clock of `tick`.
        """
        raise NotImplementedError

    def tick(self, hip, t):
        """One cycle: the HIP [m, world] at time t [s] in, (proxy [m], force [N]) out.

        A third value, the surface's unit normal, may follow; else it is the direction from the HIP
        to the proxy. In free space the proxy is at the HIP and the force is zero; so it is before
        the first frame, when this is not called.
        """
        raise NotImplementedError

    def seat(self, proxy):
        """Forget the contact: the proxy is at this place [m, world], in free motion."""

    def set_parameters(self, parameters):
        """All parameters by name (palpate.parameters()), before the first tick and when changed."""

# SPDX-License-Identifier: Apache-2.0
"""palpate: feel what a depth camera sees.

    import palpate
    touch = palpate.Renderer("sight", stiffness=500)
    touch.frame(depth, camera=camera, stamp=0.0)    # uint16, height x width
    tick = touch.tick(hip, t)                       # .force [N], .proxy [m]

`trace` runs a HIP path over a recording, `Source` gives frames of cameras and recordings,
`Session` combines cameras, a device, a method and the safety chain, and `bench` compares
methods, including your own. All numbers are in SI units, all positions in the world frame.
"""

from . import bench
from ._core import (Camera, Cloud, CloudView, DepthImage, Error, Frame, Materials, PointCloud,
                    Renderer, Session, Source, State, Tick, __version__, flags, limits, materials,
                    methods, parameters, read_session, safety_flags, trace)
from .method import Method
from .show import dataframe, plot

__all__ = [
    "Camera", "Cloud", "CloudView", "DepthImage", "Error", "Frame", "Materials", "Method",
    "PointCloud", "Renderer", "Session", "Source", "State", "Tick", "__version__", "bench",
    "dataframe", "flags", "limits", "materials", "methods", "parameters", "plot", "read_session",
    "safety_flags", "trace",
]

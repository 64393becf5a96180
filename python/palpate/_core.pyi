# SPDX-License-Identifier: Apache-2.0
# Types of the compiled module; a test holds them against it.
import enum
import os
from typing import (Any, Callable, Final, Iterable, Iterator, List, Optional, Sequence, Tuple, Union,
                    overload)

import numpy
from numpy.typing import ArrayLike, NDArray

from .method import Method

__version__: str

class Error(ValueError): ...

def parameters() -> dict[str, dict[str, Any]]: ...
def limits() -> dict[str, dict[str, Any]]: ...
def materials() -> dict[str, dict[str, float]]: ...
def methods() -> dict[str, str]: ...
def flags(bits: int) -> dict[str, str]: ...
def safety_flags(bits: int) -> dict[str, str]: ...
def trace(
    camera: Union[str, Sequence[str]],
    path: Union[None, str, os.PathLike[str], ArrayLike] = None,
    *,
    method: Union[str, Method] = "sight",
    rate: float = 1000.0,
    press: Optional[Tuple[int, int]] = None,
    slide_to: Optional[Tuple[int, int]] = None,
    press_depth: float = 0.008,
    press_speed: float = 0.05,
    press_hold: float = 0.5,
    **parameters: float,
) -> NDArray[numpy.void]: ...
def read_session(folder: Union[str, os.PathLike[str]]) -> NDArray[numpy.void]: ...

class Camera:
    def __init__(self, width: int, height: int, fx: float, fy: float, cx: float, cy: float,
                 distortion: Sequence[float] = ()) -> None: ...
    width: Final[int]
    height: Final[int]
    fx: Final[float]
    fy: Final[float]
    cx: Final[float]
    cy: Final[float]
    distortion: Final[List[float]]

class Cloud:
    def near(self, centre: ArrayLike, radius: float) -> NDArray[numpy.float64]: ...

class CloudView:
    def near(self, centre: ArrayLike, radius: float) -> NDArray[numpy.float64]: ...
    viewpoint: Final[Optional[NDArray[numpy.float64]]]

class Materials:
    def __init__(self, what: Union[str, os.PathLike[str], Iterable[dict]]) -> None: ...
    names: Final[list[str]]
    def __len__(self) -> int: ...

class DepthImage(Cloud):
    def __init__(self, depth: NDArray[numpy.uint16], camera: Camera,
                 units_per_metre: float = 1000.0,
                 world_from_camera: Optional[ArrayLike] = None,
                 materials: Optional[Materials] = None,
                 labels: Optional[NDArray[numpy.uint8]] = None,
                 brightness: Optional[NDArray[numpy.uint8]] = None,
                 noise: Optional[ArrayLike] = None) -> None: ...
    depth: Final[NDArray[numpy.uint16]]
    noise: Final[Optional[NDArray[numpy.float32]]]
    camera: Final[Camera]
    units_per_metre: Final[float]
    world_from_camera: Final[NDArray[numpy.float64]]
    def metres(self) -> NDArray[numpy.float32]: ...
    def points(self) -> NDArray[numpy.float64]: ...

class PointCloud(Cloud):
    def __init__(self, points: ArrayLike, viewpoint: Optional[ArrayLike] = None) -> None: ...
    def __len__(self) -> int: ...
    viewpoint: Final[Optional[NDArray[numpy.float64]]]
    def points(self) -> NDArray[numpy.float64]: ...

class State(enum.IntEnum):
    FREE = 0
    CONTACT = 1
    ENTRENCHMENT = 2

class Tick:
    t: Final[float]
    hip: Final[NDArray[numpy.float64]]
    proxy: Final[NDArray[numpy.float64]]
    normal: Final[NDArray[numpy.float64]]
    force: Final[NDArray[numpy.float64]]
    torque: Final[NDArray[numpy.float64]]
    orientation: Final[NDArray[numpy.float64]]
    proxy_orientation: Final[NDArray[numpy.float64]]
    contacts: Final[NDArray[numpy.float64]]
    state: Final[State]
    steps: Final[int]
    surface_velocity: Final[float]
    transient: Final[NDArray[numpy.float64]]
    hardness: Final[float]
    frame: Final[int]
    flags: Final[int]

class Renderer:
    def __init__(self, method: Union[str, Method] = "sight", *, tool: str = "",
                 **parameters: float) -> None: ...
    @overload
    def frame(self, cloud: Cloud, stamp: float) -> None: ...
    @overload
    def frame(self, depth: NDArray[numpy.uint16], *, camera: Camera, stamp: float,
              world_from_camera: Optional[ArrayLike] = None,
              units_per_metre: float = 1000.0, materials: Optional[Materials] = None,
              labels: Optional[NDArray[numpy.uint8]] = None,
              brightness: Optional[NDArray[numpy.uint8]] = None,
              noise: Optional[ArrayLike] = None) -> None: ...
    @overload
    def frame(self, points: ArrayLike, *, stamp: float,
              viewpoint: Optional[ArrayLike] = None) -> None: ...
    def tick(self, hip: ArrayLike, t: float,
             orientation: Optional[ArrayLike] = None) -> Tick: ...
    def ticks(self, hips: ArrayLike, times: ArrayLike) -> NDArray[numpy.void]: ...
    def set(self, **parameters: float) -> None: ...
    def seat(self, proxy: ArrayLike) -> None: ...
    parameters: Final[dict[str, float]]

class Frame:
    stamp: Final[float]
    cloud: Final[Union[DepthImage, PointCloud]]
    depth: Final[NDArray[numpy.uint16]]
    camera: Final[Camera]
    units_per_metre: Final[float]
    world_from_camera: Final[NDArray[numpy.float64]]
    colour: Final[Optional[NDArray[numpy.uint8]]]
    def metres(self) -> NDArray[numpy.float32]: ...
    def points(self) -> NDArray[numpy.float64]: ...

class Source:
    def __init__(self, uri: str, timeout: Optional[float] = None) -> None: ...
    def __iter__(self) -> Iterator[Frame]: ...
    def __next__(self) -> Frame: ...
    def next(self, timeout: Optional[float] = None) -> Optional[Frame]: ...
    info: Final[dict[str, Any]]

class Session:
    def __init__(
        self,
        camera: Union[str, Iterable[Tuple[Cloud, float]],
                      Sequence[Union[str, Iterable[Tuple[Cloud, float]]]]],
        device: str = "hand:",
        *,
        method: str = "sight",
        free_running: bool = False,
        rate: float = 1000.0,
        record: str = "",
        stroke_time: float = 20.0,
        world_from_device: Optional[ArrayLike] = None,
        scale: float = 1.0,
        limits: dict[str, float] = {},
        without_watchdog: bool = False,
        fixtures: str | None = None,
        hands: Iterable[Union[str, dict[str, Any]]] = (),
        materials: Optional[Materials] = None,
        labels: Optional[
            Callable[[int, NDArray[numpy.uint16]], Optional[NDArray[numpy.uint8]]]
        ] = None,
        tool: str = "",
        **parameters: float,
    ) -> None: ...
    def __enter__(self) -> Session: ...
    def __exit__(self, *args: Any) -> None: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...
    def run(self, duration: Optional[float] = None) -> None: ...
    def ticks(self, hand: int = 0) -> NDArray[numpy.void]: ...
    lost: Final[int]
    def state(self) -> dict[str, Any]: ...
    def clouds(self) -> List[Optional[Cloud]]: ...
    def set(self, method: Optional[str] = None, tool: Optional[str] = None,
            **parameters: float) -> None: ...
    def fixtures(self, fixtures: str | None) -> None: ...
    def limit(self, **limits: float) -> None: ...
    def reset_faults(self) -> None: ...
    def start_recording(self, folder: str) -> None: ...
    def stop_recording(self) -> None: ...

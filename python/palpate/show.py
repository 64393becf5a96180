# SPDX-License-Identifier: Apache-2.0
"""Ticks as a pandas DataFrame and as a figure, if pandas and matplotlib are installed."""

import numpy


def dataframe(ticks):
    """A DataFrame of ticks (of `trace`, `Renderer.ticks`, `Session.ticks`), indexed by time [s].

    Vectors become three columns: force_x, force_y, force_z.
    """
    import pandas  # here, so that palpate needs numpy alone

    columns = {}
    for name in ticks.dtype.names:
        values = ticks[name]
        if values.ndim == 2:
            for axis, letter in enumerate("xyz"):
                columns[f"{name}_{letter}"] = values[:, axis]
        elif name != "t":
            columns[name] = values
    return pandas.DataFrame(columns, index=pandas.Index(ticks["t"], name="t"))


def plot(ticks, axis=None, file=None):
    """A figure of ticks: force [N] above, distance between proxy and HIP [mm] below.

    axis: 0, 1 or 2 for one component of the force instead of its length. file: where it is
    written, e.g. "touch.png". Returns the matplotlib figure.
    """
    from matplotlib.figure import Figure  # no window is needed

    figure = Figure(figsize=(8, 5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    force = ticks["force"]
    above.plot(ticks["t"], numpy.linalg.norm(force, axis=1) if axis is None else force[:, axis])
    above.set_ylabel("force [N]" if axis is None else f"force along {'xyz'[axis]} [N]")
    below.plot(ticks["t"], 1e3 * numpy.linalg.norm(ticks["proxy"] - ticks["hip"], axis=1))
    below.set_ylabel("proxy to HIP [mm]")
    below.set_xlabel("time [s]")
    for each in (above, below):
        each.grid(alpha=0.3)
    if file is not None:
        figure.savefig(file)
    return figure

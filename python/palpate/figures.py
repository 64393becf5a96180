# SPDX-License-Identifier: Apache-2.0
"""Draws CSV files of `palpate eval`, `trace` and `bench --growth`, if matplotlib is installed.

`python3 -m palpate.figures FILE.csv...` writes FILE.svg beside each; in the sources, without the
package, `python3 python/palpate/figures.py FILE.csv...`.
"""

import csv
import itertools
import math
import pathlib
import sys

R_C = 5e-3  # [m] in whose units the paper has lengths
MARKS = "os^D*vP"


def _methods(rows):
    return list(dict.fromkeys(row["method"] for row in rows))


def _of(rows, **wanted):
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def _numbers(rows, column, unit=1.0):
    return [float(row[column]) / unit for row in rows]


def _curves(axes, rows, x, y, units=(1.0, 1.0), style="-", reference=(), reference_style="--",
            **labels):
    """A curve a method, and in grey the columns `reference`, (name, x, y), that they share."""
    for name, x_of, y_of in reference:
        first = _of(rows, method=_methods(rows)[0])
        axes.plot(_numbers(first, x_of, units[0]), _numbers(first, y_of, units[1]),
                  reference_style, color="grey", label=name)
    for method in _methods(rows):
        own = _of(rows, method=method)
        axes.plot(_numbers(own, x, units[0]), _numbers(own, y, units[1]), style, label=method)
    axes.set(**labels)


def _drawn(*curves):
    """A figure with a panel for each of what _curves takes."""
    def figure(rows, panels):
        for axes, of_panel in zip(panels(len(curves)), curves):
            _curves(axes, rows, **of_panel)
    return figure


def _groups(axes, rows, group, value, **labels):
    """A line a group and in it a mark a method. value: of a group's rows of one method."""
    names = list(dict.fromkeys(filter(None, map(group, rows))))
    for method, mark in zip(_methods(rows), itertools.cycle(MARKS)):
        found = [(value(own), i) for i, name in enumerate(names)
                 if (own := [r for r in rows if r["method"] == method and group(r) == name])]
        axes.plot([x for x, _ in found], [i for _, i in found], mark, label=method)
    axes.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5), **labels)
    axes.figure.set_figheight(max(axes.figure.get_figheight(), 1.5 + 0.2 * len(names)))


_flat = _drawn(
    dict(x="t", y="proxy_y", reference=[("HIP", "t", "hip_y")], xlabel="time [s]",
         ylabel="height y [m]"),
    dict(x="t", y="contact_y", units=(1.0, 1e-3), xlabel="time [s]",
         ylabel="contact point y [mm]", xlim=(1.2, 3.9), ylim=(-0.2, 0.1)))
_single_lift = _drawn(
    dict(x="t", y="proxy_y", units=(1.0, R_C), style=".-", xlabel="time [s]",
         ylabel="height y [r_c]",
         reference=[("true surface", "t", "true_y"), ("HIP", "t", "hip_y")]))
_bound = _drawn(
    dict(x="noise_rc", y="h_m", units=(1.0, 1e-3), style=".-", xlabel="noise sigma [r_c]",
         ylabel="thickness h [mm]", reference=[("(23)", "noise_rc", "printed_h_m")]),
    dict(x="noise_rc", y="e_n", style=".-", xlabel="noise sigma [r_c]",
         ylabel="normal error e_n", reference=[("(24)", "noise_rc", "printed_e_n")]))
_corners = _drawn(
    dict(x="contact_x", y="contact_z", units=(R_C, R_C), xlabel="x [r_c]", ylabel="height [r_c]",
         reference=[("surface", "contact_x", "true_z")], reference_style=":"))
_scan = _drawn(
    dict(x="proxy_y", y="proxy_z", xlabel="along the scan y [m]", ylabel="z [m]",
         reference=[("surface", "proxy_y", "surface_z"), ("HIP", "hip_y", "hip_z")]),
    dict(x="hip_y", y="force_n", xlabel="along the scan y [m]", ylabel="force [N]"))


def _lift(rows, panels):
    """What each method held, and (25) with (20), solved for the acceleration."""
    f_c, r_1, noises = 30.0, 4.99e-3, [0.01 * i for i in range(301)]
    bound = []
    for s in (R_C * noise for noise in noises):
        h = 5.5e4 * s**4 - 6.7e3 * s**3 + 63.0 * s * s + s - 4.1e-5  # (23)
        e = 2.9e10 * s**5 - 6.4e8 * s**4 + 4.8e6 * s**3 - 1.2e4 * s * s + 16.0 * s  # (24)
        bound.append((r_1 + h - 0.1 / f_c * e) / ((1.0 + 9.0 * e) / f_c**2) / R_C)
    methods = _methods(rows)
    for axes, method in zip(panels(len(methods), 2), methods):
        held = _of(rows, method=method, popped="0")
        axes.plot(_numbers(held, "acceleration_rc"), _numbers(held, "noise_rc"), ".", label="held",
                  rasterized=True)  # some thousand
        axes.plot(bound, noises, label="(25)")
        axes.set(title=method, xlabel="acceleration a [r_c/s²]", ylabel="noise sigma [r_c]",
                 xlim=(0, 1400), ylim=(0, 3))


def _aims(rows, panels):
    axes, = panels(1)
    rows = [row for row in rows
            if row["aim"] != "-" and row.get("loop", "path") in ("path", "free")]
    ratio = lambda own: float(own[-1]["value"]) / (float(own[-1]["aim"]) or math.nan)
    _groups(axes, rows, lambda row: f"{row['scene']} {row['measure']}", ratio,
            xlabel="measured / aim", xscale="log", xlim=(1e-3, 1e3))
    axes.axvline(1.0, color="grey")


def _held(rows, panels):
    cases = lambda own: sum(_numbers(own, "cases"))
    _groups(*panels(1), rows, lambda row: row["family"],
            lambda own: 100.0 * (1.0 - sum(_numbers(own, "lost")) / cases(own)),
            xlabel="held [%]", xlim=(-2, 102))


def _right(rows, panels):
    known = _of(rows, unknown="-")
    _groups(*panels(1), known, lambda row: row["class"],
            lambda own: 100.0 * sum(_numbers(own, "right")) / len(own),
            xlabel="right [%]", xlim=(-2, 102))


def _cameras(rows, panels):
    names = {"first": "first alone", "second": "second alone", "both": "both",
             "weighed": "weighed by variance"}
    marks = [dict(row, rig=f"{row['rig']} {row['method']}", method=name, rms=row[column])
             for row in rows for column, name in names.items()]
    _groups(*panels(1), marks, lambda row: row["rig"], lambda own: float(own[0]["rms"]),
            xlabel="force at rest [N rms]", xscale="log")


def _zwidth(rows, panels):
    """The worst of scenes and cameras, beside theory."""
    axes, = panels(1)
    wall = lambda row: f"{row['device']} {row['hand']} k_d={row['damping']}"
    ways = {"straight": ", worst scene", "chain": ", through the chain"}
    beside = {"bound": "2(b+k_d)/(T+2t_d)", "linear": "linear loop, no friction"}
    marks = [dict(row, method=row["method"] + ways[row["way"]], shown=row["stiffness"])
             for row in rows] + [dict(row, method=name, shown=row[column])
                                 for row in rows for column, name in beside.items()]
    _groups(axes, marks, wall, lambda own: min(_numbers(own, "shown")), xscale="log",
            xlim=(50, 1e4), xlabel="largest stable stiffness [N/m]")
    axes.axvline(1500.0, color="grey", linestyle="--")


def _cases(group, *columns, **labels):
    """A figure with a panel a column, of the first row of each group and method."""
    def figure(rows, panels):
        for axes, column in zip(panels(len(columns), 2), columns):
            _groups(axes, rows, group, lambda own, column=column: float(own[0][column] or "nan"),
                    xlabel=column, **labels)
    return figure


_tool = _cases(lambda row: f"{row['case']} {row['camera']}", "force_error", "torque_error",
               xscale="log", xlim=(1e-4, 10))
_splat = _cases(lambda row: f"{row['body']} {row['splat']}", "held", "error")


def _tool_cases(rows, panels):
    """Cases that were behind, and for how long at most, by family."""
    share, longest = panels(2, 2)
    family = lambda row: row["family"]
    cases = lambda own: sum(_numbers(own, "cases"))
    _groups(share, rows, family, lambda own: 100.0 * sum(_numbers(own, "behind")) / cases(own),
            xlabel="behind for 0.1 s [%]", xlim=(-2, 102))
    _groups(longest, rows, family, lambda own: max(_numbers(own, "longest")),
            xlabel="longest behind [s]")


def _turning(rows, panels):
    rate, stiffest = panels(2, 2)
    tool = lambda row: f"{row['tool']} {row['grip']}"
    ways = {"free_rate": "without a bound", "rate": "with a session's"}
    marks = [dict(row, method=name, rate=row[column])
             for row in rows for column, name in ways.items()]
    _groups(rate, marks, tool, lambda own: float(own[0]["rate"]),
            xlabel="rate of turning [rad/s]")
    _groups(stiffest, [dict(row, method="stiffest at rest") for row in rows], tool,
            lambda own: float(own[0]["stiffest"]), xscale="log",
            xlabel="stiffness in rotation [N m/rad]")


def _materials(rows, panels):
    impact, press, slide, grain = panels(4, 2)
    for i, name in enumerate(dict.fromkeys(row["material"] for row in rows)):
        own = _of(rows, material=name)

        def draw(axes, begin, end, x, y, shift=0.0, unit=1.0, own=own, name=name):
            seen = [row for row in own if begin - 1e-9 <= float(row["t"]) < end - 1e-9]
            values = _numbers(seen, y)
            less = sum(values) / len(values) + 0.5 * i if axes is grain else 0.0
            axes.plot([(value - shift) / unit for value in _numbers(seen, x)],
                      [value - less for value in values], label=name)
        draw(impact, 1.925, 2.0, "t", "normal", 1.8 + 0.02 / 0.15, 1e-3)
        draw(press, 2.6, 3.6, "depth", "normal")
        draw(slide, 4.2, 4.2 + 0.04 / 0.06, "along", "tangential")
        draw(grain, 4.6, 4.7, "t", "normal", 4.6, 1e-3)
    impact.set(title="an impact at 0.15 m/s", xlabel="time [ms]", ylabel="normal force [N]")
    press.set(title="a slow press", xlabel="depth of the HIP [mm]", ylabel="normal force [N]")
    slide.set(title="a slide at 60 mm/s, 3 mm deep", xlabel="travel of the HIP [mm]",
              ylabel="force along the surface [N]")
    grain.set(title="the same, a tenth of a second of it", xlabel="time [ms]",
              ylabel="normal, less its mean [N]")


def _teleop(rows, panels):
    force, swing = panels(2)
    for way in dict.fromkeys(row["way"] for row in rows):
        own = _of(rows, way=way, scene="rest", link="even",
                  sensor="d4xx" if way == "palpate" else "ideal")
        for axes, column in ((force, "force"), (swing, "swing")):
            axes.plot(_numbers(own, "round_trip"), _numbers(own, column), ".-", label=way)
    force.set(xlabel="round trip [ms]", ylabel="force on the hand [N]")
    swing.set(xlabel="round trip [ms]", ylabel="deviation of the tool [mm]", yscale="log")


def _teleop_faults(rows, panels):
    axes, = panels(1)
    for fault in dict.fromkeys(row["fault"] for row in rows):
        contact = sorted(_numbers(_of(rows, fault=fault), "contact"))
        axes.step(contact, [(i + 1) / len(contact) for i in range(len(contact))], where="post",
                  label=fault)
    axes.set(xlabel="contact of the tool [N]", ylabel="share of episodes")


def _real(rows, panels):
    axes, = panels(1)
    for i, method in enumerate(_methods(rows)):
        for action, mark, fill in (("hold", "o", f"C{i}"), ("moving", "o", "none")):
            own = _of(rows, method=method, action=action, lost="0")
            axes.plot(_numbers(own, "distance_m"), _numbers(own, "felt_n"), mark, color=f"C{i}",
                      markerfacecolor=fill, label=f"{method} {action}")
        lost = _of(rows, method=method, action="hold", lost="1")
        axes.plot(_numbers(lost, "distance_m"), _numbers(lost, "lost"), "x", color=f"C{i}",
                  label=f"{method} lost")  # where there is nothing to measure: at 1 N
    axes.set(xlabel="distance from the camera [m]", ylabel="force in 20 to 400 Hz [N rms]",
             yscale="log")


def _growth(rows, panels):
    """A tick against what might make it grow."""
    columns = {"image_width": ("x", "image width [px]"), "cameras": ("x", "cameras"),
               "focal_length": ("points", "points in the patch"),
               "frame_rate": ("x", "frame rate [Hz]"),
               "depth_mm": ("x", "depth of the HIP [mm]"),
               "unorganised": ("x", "unorganised points")}
    for axes, (series, (column, label)) in zip(panels(len(columns), 3), columns.items()):
        own = _of(rows, series=series)
        axes.plot(_numbers(own, column), _numbers(own, "tick_us"), "o-")
        axes.set(xlabel=label, ylabel="tick [µs]", ylim=(0, None),
                 xscale="log" if series == "unorganised" else "linear")


def _trace(rows, panels):
    """Heights and force along y, as in Fig. 16."""
    height, force = panels(2)
    height.plot(_numbers(rows, "hip_y"), _numbers(rows, "hip_z"), "--", color="grey",
                label="hand (HIP)")
    height.plot(_numbers(rows, "proxy_y"), _numbers(rows, "proxy_z"), label="proxy")
    force.plot(_numbers(rows, "hip_y"),
               [math.hypot(*(float(row[f"force_{axis}"]) for axis in "xyz")) for row in rows],
               label="force")
    height.set(xlabel="along y [m]", ylabel="height z [m]")
    force.set(xlabel="along y [m]", ylabel="force [N]")


FIGURES = {"flat": _flat, "single-lift": _single_lift, "lift": _lift, "bound": _bound,
           "corners": _corners, "scan": _scan, "fidelity": _aims, "feel": _aims,
           "cameras": _cameras, "zwidth": _zwidth, "tool": _tool, "tool-cases": _tool_cases,
           "turning": _turning, "materials": _materials, "teleop": _teleop,
           "teleop-faults": _teleop_faults, "pop": _held, "field": _right, "visits": _right,
           "real": _real, "splat": _splat, "growth": _growth}


def draw(file):
    """The figure of a CSV: of the experiment that it is named after, or else of a trace."""
    from matplotlib.figure import Figure  # no window is needed

    with open(file, newline="", encoding="utf-8") as opened:
        rows = list(csv.DictReader(opened))
    figure = Figure(figsize=(9, 4), layout="constrained")

    def panels(count, columns=1):
        columns = min(columns, count)
        lines = -(-count // columns)
        figure.set_figheight(4.0 if lines == 1 else 2.5 * lines)
        return figure.subplots(lines, columns, squeeze=False).flat[:count]
    FIGURES.get(pathlib.Path(file).stem, _trace)(rows, panels)
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    if figure.axes[0].get_legend_handles_labels()[0]:
        figure.axes[0].legend(fontsize="small")
    return figure


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    import matplotlib

    matplotlib.rcParams["svg.hashsalt"] = "palpate"  # the same figure gives the same bytes
    matplotlib.rcParams["svg.fonttype"] = "none"  # text, not outlines: a tenth of the bytes
    for path in map(pathlib.Path, sys.argv[1:]):
        draw(path).savefig(path.with_suffix(".svg"), dpi=200, metadata={"Date": None})
        print(path.with_suffix(".svg"))
